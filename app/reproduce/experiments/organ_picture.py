"""True and reconstructed organ from the side, with the error in color."""

from io import BytesIO

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from app.arrays import Array, Indices
from app.recording.modes import View
from app.reproduce.experiments.organ import FRAMES_PER_BEAT, REST_FRAMES
from reconstruction.camera import nearest_rotation
from tracking.tracks import Tracks

DPI = 110
WORST = 0.15  # error at the end of the color scale, as a share of the true shape's RMS radius
LIGHT = np.array([-0.45, -0.65, -0.62])


def organ_picture(S: Array, tracks: Tracks, faces: Indices) -> bytes:
    """A PNG: four moments of the last whole beat; the truth above, the reconstruction (F, 3, p) below."""
    assert tracks.S_gt is not None
    last = REST_FRAMES + (len(S) - 1 - REST_FRAMES) // FRAMES_PER_BEAT * FRAMES_PER_BEAT
    frames = [max(0, last - FRAMES_PER_BEAT + round(k * FRAMES_PER_BEAT / 4)) for k in range(4)]
    figure = Figure(figsize=(11, 5.2), facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    shapes = [pair(S[f], tracks.S_gt[f], tracks.S_gt[0]) for f in frames]
    view = View.three_quarter()
    x, y = 1.05 * np.max([np.abs(view.flat(truth)).max(axis=0) for _, truth in shapes], axis=0)
    all_axes = figure.subplots(2, 4)
    for column, (ours, truth) in enumerate(shapes):
        error = np.linalg.norm(ours - truth, axis=0) / np.sqrt((truth**2).sum() / truth.shape[1])
        for row, (shape, values) in enumerate(((truth, None), (ours, error / WORST))):
            axes = all_axes[row, column]
            axes.add_collection(surface(shape, faces, view, values))
            axes.set(xlim=(-x, x), ylim=(-y, y), aspect="equal")
            axes.set_axis_off()
        all_axes[0, column].set_title(f"frame {frames[column]}", fontsize=10)
    figure.suptitle(
        f"true (above), reconstructed (below); red: {WORST:.0%} of the organ's radius away from the truth", fontsize=10
    )
    picture = BytesIO()
    figure.savefig(picture, format="png", dpi=DPI)
    return picture.getvalue()


def pair(ours: Array, truth: Array, rest: Array) -> tuple[Array, Array]:
    """Both centred, the truth turned as the first true shape `rest` is, ours laid over it with one scale."""
    ours, truth, rest = (shape - shape.mean(axis=1, keepdims=True) for shape in (ours, truth, rest))
    truth = nearest_rotation((rest @ truth.T)[None])[0] @ truth
    ours = nearest_rotation((truth @ ours.T)[None])[0] @ ours
    return np.asarray(ours * ((ours * truth).sum() / (ours * ours).sum())), truth


def surface(shape: Array, faces: Indices, view: View, values: Array | None) -> PolyCollection:
    """A shaded surface (3, p), the farthest triangles first; values (p,) from 0 to 1 turn it red."""
    a, b, c = (shape[:, faces[:, k]] for k in range(3))
    normals = np.cross((b - a).T, (c - a).T)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True).clip(1e-12)
    light = 0.45 + 0.55 * np.abs(normals @ (view.axes.T @ LIGHT / np.linalg.norm(LIGHT)))
    amount = np.zeros(len(faces)) if values is None else values[faces].mean(axis=1).clip(0, 1)
    color = (1 - amount[:, None]) * np.array([0.86, 0.84, 0.80]) + amount[:, None] * np.array([0.80, 0.20, 0.12])
    order = np.argsort(-(view.axes[2] @ shape)[faces].mean(axis=1))
    polygons = view.flat(shape)[faces[order]]
    shades = (color * light[:, None])[order]
    return PolyCollection(list(polygons), facecolors=shades, edgecolors=shades, linewidths=0.3)
