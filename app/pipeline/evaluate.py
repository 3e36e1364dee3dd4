"""Reconstruct given tracks and score them against the truth in their file."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from app.arrays import Array, Flags
from app.files.mesh_file import rest_of_vertices
from app.files.track_file import load_tracks
from app.files.writing import check_outputs
from app.options.evaluate import Evaluate
from app.pipeline.estimates import Collected, Scores, save_shapes, sigmas
from app.pipeline.prepare import settings_of
from app.pipeline.quality.finding import Grade
from app.pipeline.quality.verdict import verdict
from app.pipeline.stages.messages import RECOVERED
from app.pipeline.summary import KINDS
from app.terminal.errors import UsageError
from app.terminal.progress import Progress
from app.terminal.summary import Summary, print_lines
from reconstruction.basis import rest_shape
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.rest_shape import RestShape
from reconstruction.camera import Camera
from reconstruction.estimate import ShapeEstimate
from reconstruction.evaluation import score, with_missing, with_noise, with_outliers
from reconstruction.online import Reconstruction
from reconstruction.unknown_camera import likely_camera
from tracking.extent import check_extent
from tracking.tracks import Tracks, known_points

FEWEST_FRAMES = 2  # that a point is seen in: one has no depth
MOST_POINTS = 100_000  # take 2 GB
MOST_VALUES = 100_000_000  # points in all frames


@dataclass(frozen=True, kw_only=True)
class Evaluation(Summary):
    """What came of given tracks; the score is there if the truth is."""

    tracks: str
    verdict: Grade
    verdict_reason: str
    frames: int
    points: int
    modes: int
    rest_shape: str
    rest_shape_note: str
    focal_px: float | None
    focal_note: str = ""
    bootstrap_frames: int
    deformation: str
    metric: str | None
    priors: Mapping[str, float]
    branch_switches: int
    reprojection_rms: float | None
    ms_per_frame: float
    score: Scores | None = None
    e3d_online: float | None = None

    def print_short(self) -> None:
        """The verdict, and what it is about."""
        e3d = None if self.score is None else f"e3d {self.score.e3d:.2%}, rest shape alone {self.score.e3d_static:.2%}"
        print_lines(
            f"{self.verdict}: {self.verdict_reason}",
            {
                "surface": f"{KINDS.get(self.rest_shape, self.rest_shape)}, {self.points} points, {self.modes} modes",
                "frames": f"{self.frames} of {self.ms_per_frame:.1f} ms",
                "error": None if self.reprojection_rms is None else f"{self.reprojection_rms:.4g}, RMS",
                "against the truth": e3d,
            },
        )


def evaluate(config: Evaluate, progress: Progress) -> Evaluation:
    """Run the reconstruction over a track file.

    Returns:
        the scores.

    Raises:
        UsageError, TrackingError, ReconstructionError: what stands in the way, and the remedy.
    """
    check_outputs({"--shapes-out": config.shapes_out}, (config.tracks, config.rest_shape), overwrite=config.overwrite)
    tracks = load_tracks(config.tracks)
    if tracks.note:
        progress.log(tracks.note)
    frames, _, points = tracks.W.shape
    for most, of, what in ((MOST_POINTS, points, "points"), (MOST_VALUES, frames * points, "points in all frames")):
        if of > most:
            step = -(-of // most)
            raise UsageError(f"{config.tracks} has {of:,} {what}, at most {most:,} are possible: take one of {step}")
    rng = np.random.default_rng(config.seed)
    W = with_noise(np.where(tracks.visible[:, None], tracks.W, np.nan), config.noise, rng)
    visible = with_missing(tracks.visible, config.missing, rng)
    if config.outliers:
        W = with_outliers(W, tracks.visible, config.outliers, rng)
    kept = visible.sum(axis=0) >= FEWEST_FRAMES
    if not kept.any():
        raise UsageError(f"{config.tracks} shows no point in {FEWEST_FRAMES} frames: there is nothing to reconstruct")
    if config.rest_shape in RECOVERED and not kept.all():  # nobody knows where the others are
        tracks = tracks.of_points(kept)
        W, visible = W[:, :, kept], visible[:, kept]
        progress.log(f"{int((~kept).sum())} of {points} points are seen in fewer than {FEWEST_FRAMES} frames: left out")
    check_extent(W, visible)
    reconstruction = prepare(config, tracks, progress, (W, visible) if config.final_pass else None)
    collected = Collected(everything=True)
    with progress:
        progress.expect(frames)
        started = perf_counter()
        estimates = online = reconstructed(reconstruction, W, visible, progress)
        estimates += reconstruction.finish()
        if config.final_pass and reconstruction.revise(zip(W, visible, strict=True)):
            estimates = reconstructed(reconstruction, W, visible, progress)
        elapsed_ms = (perf_counter() - started) * 1e3
    if not all(np.isfinite(estimate.shape).all() for estimate in (*online, *estimates)):
        raise UsageError(f"the points of {config.tracks} fit no shape: try another --rest-shape or --camera")
    for k, estimate in enumerate(estimates):
        collected.add(k, estimate)
    rest = reconstruction.rest
    assert rest is not None
    if config.shapes_out:
        save_shapes(config.shapes_out, collected.estimates, reconstruction.model)
    scores = before = None
    if tracks.S_gt is not None and tracks.gt_frames is not None:
        truth = tracks.S_gt, tracks.gt_frames

        def scored(made: list[ShapeEstimate]) -> Scores:
            kept = [made[int(f)] for f in truth[1]]
            return Scores.of(score(np.stack([e.shape for e in kept]), rest.motion.shape, *truth, sigmas(kept)))

        scores, before = scored(estimates), scored(online)
    camera = reconstruction.camera
    word = verdict(collected.course, reconstruction.map)
    return Evaluation(
        tracks=str(config.tracks),
        verdict=word.grade,
        verdict_reason=word.reason,
        frames=frames,
        points=int(kept.sum()) if config.rest_shape in RECOVERED else points,
        modes=len(reconstruction.model.basis.eigenvalues),
        rest_shape=rest.kind,
        rest_shape_note=rest.note,
        focal_px=camera.focal_px if camera.perspective else None,
        focal_note=reconstruction.focal_note,
        bootstrap_frames=reconstruction.bootstrap_frames,
        deformation=reconstruction.deformation,
        metric=reconstruction.metric,
        priors=reconstruction.weights,
        branch_switches=collected.switches,
        reprojection_rms=collected.reprojection_rms_px,
        ms_per_frame=elapsed_ms / frames,
        score=scores,
        e3d_online=before.e3d if before and estimates is not online else None,
    )


def reconstructed(reconstruction: Reconstruction, W: Array, visible: Flags, progress: Progress) -> list[ShapeEstimate]:
    """The shapes known with each frame of tracks W (F, 2, P) px, visible (F, P)."""
    estimates = []
    for frame, (w, h) in enumerate(zip(W, visible, strict=True)):
        try:
            estimates += reconstruction.update(np.where(h, w, np.nan), h)
        except np.linalg.LinAlgError as error:  # the numbers have grown beyond all bounds
            raise UsageError(f"the points of frame {frame} fit no shape: try another --rest-shape") from error
        progress.advance(reconstruction.phase.value)
    return estimates


def prepare(
    config: Evaluate, tracks: Tracks, progress: Progress, frames: tuple[Array, Flags] | None = None
) -> Reconstruction:
    """The estimator for given tracks, before their first frame.

    Args:
        config: what the person asked for.
        tracks: the file.
        progress: is told if a camera has been found.
        frames: points (F, 2, P) px and visibility (F, P) in all frames, to find a camera by that nobody knows.

    Raises:
        UsageError: no such rest shape or camera in the file.
    """
    given, mesh = given_rest_shape(config, tracks)
    settings = settings_of(config.model, config.rest_shape, estimate_focal=config.model.focal == "auto")
    camera = camera_of(config, tracks)
    unknown = config.camera == "auto" and not camera.perspective
    if frames and unknown and given is None and settings.maps:
        camera = likely_camera(*frames, settings.kind)
        if camera.perspective:
            settings = replace(settings, estimate_focal=True)
            progress.log("no camera is given; what is seen changes less in perspective: --camera orthographic overrules")
    return Reconstruction(camera, settings, given, mesh)


def given_rest_shape(config: Evaluate, tracks: Tracks) -> tuple[RestShape | None, Mesh | None]:
    """The rest shape from the truth or a file, if that is what was asked for.

    Raises:
        UsageError: the file has no truth, or the mesh does not fit.
    """
    if config.rest_shape in RECOVERED:
        return None, None
    if config.rest_shape == "first-truth":
        if tracks.S_gt is None:
            raise UsageError(f"{config.tracks} has no true shapes S_gt: choose another --rest-shape")
        if not known_points(tracks.S_gt[:1]).all():
            raise UsageError(f"the first true shape in {config.tracks} lacks points: choose another --rest-shape")
        return rest_shape.given(tracks.S_gt[0], "truth", "first true shape"), None
    return rest_of_vertices(Path(config.rest_shape), tracks.W.shape[2])


def camera_of(config: Evaluate, tracks: Tracks) -> Camera:
    """The camera asked for, from the file's K and the options.

    Raises:
        UsageError: perspective without a focal length.
    """
    focal, K = config.model.focal, tracks.K
    if config.camera == "orthographic" or (config.camera == "auto" and K is None and focal is None):
        return Camera()
    if K is not None:
        camera = Camera(float(K[0, 0]), K[:2, 2].copy())
        return replace(camera, focal_px=focal) if isinstance(focal, float) else camera
    if focal is None:
        raise UsageError(f"{config.tracks} has no K: give --focal, or --camera orthographic")
    seen = np.where(tracks.visible[:, None], tracks.W, np.nan)
    if focal == "auto":  # the picture's longer side, which is about as long as where points move
        focal = float((np.nanmax(seen, axis=(0, 2)) - np.nanmin(seen, axis=(0, 2))).max())
    return Camera(focal, np.nanmean(seen, axis=(0, 2)))
