"""How far tracked points are from where they belong, by the truth of a video."""

from pathlib import Path

import numpy as np

from app.files.track_file import load_tracks, load_truth
from reconstruction.basis.mesh import locate, triangulate


def drift_px(tracks_file: Path, truth_file: Path) -> float:
    """Distance of true points from where the triangles of the tracked points take them, px: median over points and frames.

    Args:
        tracks_file: of `--tracks-out`, from the video's first frame on.
        truth_file: of `--ground-truth`.
    """
    tracks, truth = load_tracks(tracks_file), load_truth(truth_file)
    known = truth.frames < len(tracks.W)
    frames, places = truth.frames[known], truth.W_px[known].transpose(0, 2, 1)
    W, visible = tracks.W[frames].transpose(0, 2, 1), tracks.visible[frames]
    begin = np.flatnonzero(visible[0])
    mesh = triangulate(W[0, begin])
    face, weights = locate(W[0, begin], mesh, places[0])
    inside = face >= 0
    corners = begin[mesh.faces[face[inside]]]
    taken = np.einsum("fnkd,nk->fnd", W[:, corners], weights[inside])
    off = np.linalg.norm(taken - places[:, inside], axis=2)
    return float(np.nanmedian(np.where(visible[:, corners].all(axis=2), off, np.nan)[1:]))
