"""What came out of a run, for people and programs, and what is counted on the way."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from app.pipeline.estimates import Scores
from app.pipeline.quality.finding import Grade
from app.pipeline.quality.keyframes import RECOVERED
from app.pipeline.quality.verdict import verdict
from app.pipeline.stopwatch import Stopwatch
from app.pipeline.tracked_object import TrackedObject
from app.terminal.exit_code import ExitCode
from app.terminal.summary import Summary, print_lines
from tracking.guarded import Change, Guarded
from tracking.sources.capture import few_bits

KINDS = RECOVERED | {"mesh": "mesh given", "truth": "shape given"}


@dataclass
class Counts:
    """Counts of a run; nothing in it grows with the frames.

    Attributes:
        frames: so many so far.
        objects: followed so far, one after another.
        frames_lost: frames without the surface.
        losses: how often it was lost, and
        recoveries: found again.
    """

    frames: int = 0
    objects: int = 1
    frames_lost: int = 0
    losses: int = 0
    recoveries: int = 0
    _share: float = 0.0
    _share_sum: float = 0.0

    def add(self, guarded: Guarded, *, lost: bool) -> None:
        """Count a frame, what was seen in it, and whether it is one without the surface."""
        self.frames += 1
        self.frames_lost += lost
        self.losses += guarded.change is Change.LOST
        self.recoveries += guarded.change is Change.RECOVERED
        self._share = float(guarded.observation.visible.mean())
        self._share_sum += self._share

    @property
    def visible_share(self) -> float | None:
        """Share of the points seen, mean over the frames."""
        return self._share_sum / self.frames if self.frames else None

    @property
    def visible_share_last(self) -> float | None:
        """In the last frame."""
        return self._share if self.frames else None


@dataclass(frozen=True, kw_only=True)
class RunSummary(Summary):
    """Counts of the whole run, and what came out for one object; what has a default may be unknown, and is left out then.

    Attributes:
        source: the video.
        verdict: how good it is, in a word, and
        verdict_reason: why, and what helps.
        frames: so many were processed.
        interrupted: whether it ended before the video did.
        points: vertices of the mesh.
        rest_shape: how it was found; None without one.
        rest_shape_note: the same in words.
        bootstrap_frames: frames it comes from.
        deformation: constraint in force.
        metric: dissimilarity the modes come from.
        priors: weights in force.
        focal_px: focal length; None for an orthographic camera.
        focal_note: how it was found.
        mm_per_px: millimetres in a pixel of the first frame, if a length is known.
        branch_switches: how often the window took another branch.
        reprojection_rms_px: over all visible points of all frames.
        revisions: how often another model replaced the one before, on the way.
        shapes: whether what came out is of the final pass, or as it was shown on the way.
        score: errors against the truth.
        e3d_online: the error of what was shown on the way, if there was another pass.
        visible_share: of the points, mean over the frames.
        visible_share_last: in the last frame.
        objects: followed one after another.
        losses: how often the surface was lost, and
        recoveries: found again.
        frames_lost: frames without it.
        fps: frames processed a second.
        stage_ms: mean milliseconds a frame, by stage.
        latency_ms: from a frame that is read to its mesh, once there is a model: median, 95th percentile and worst.
        recording: the first file written.
        parts: number of files, if there are several.
        last_part: the last of them.
        own_parts: those that show the object, if there was more than one.
    """

    source: str
    verdict: Grade
    verdict_reason: str
    frames: int
    interrupted: bool
    points: int
    rest_shape: str | None
    rest_shape_note: str | None
    bootstrap_frames: int
    deformation: str
    metric: str | None
    priors: Mapping[str, float]
    focal_px: float | None
    focal_note: str | None = None
    mm_per_px: float | None = None
    branch_switches: int
    reprojection_rms_px: float | None
    revisions: int
    shapes: Literal["final pass", "on-line"]
    score: Scores | None = None
    e3d_online: float | None = None
    visible_share: float | None
    visible_share_last: float | None
    objects: int
    losses: int
    recoveries: int
    frames_lost: int
    fps: float
    stage_ms: Mapping[str, float]
    latency_ms: Mapping[str, float] | None = None
    recording: Path | None = None
    parts: int | None = None
    last_part: Path | None = None
    own_parts: tuple[str, ...] | None = None

    def print_short(self) -> None:
        """The verdict, and what it is about."""
        focal = "" if self.focal_px is None else f", focal length {self.focal_px:.0f} px"
        share = f", {self.visible_share:.0%} seen" if self.visible_share is not None else ""
        lost = f", lost {self.losses} times" if self.losses else ""
        own = f"; this is the one in {' and '.join(self.own_parts)}" if self.own_parts else ""
        print_lines(
            f"{self.verdict}: {self.verdict_reason}",
            {
                "surface": f"{KINDS.get(str(self.rest_shape), self.rest_shape)}, {self.points} points{share}{lost}{focal}",
                "frames": f"{self.frames} at {self.fps:.1f} a second{', interrupted' if self.interrupted else ''}",
                "error": None if self.reprojection_rms_px is None else f"{self.reprojection_rms_px:.2f} px, RMS",
                "against the truth": None if self.score is None else f"e3d {self.score.e3d:.2%}",
                "scale": None if self.mm_per_px is None else f"{self.mm_per_px:.4g} mm in a pixel of the first frame",
                "objects": f"{self.objects}, one after another{own}" if self.objects > 1 else None,
                "recording": self.recording if self.parts is None else f"{self.recording} to {self.last_part}",
            },
        )

    @property
    def hint(self) -> str:
        """How to look at the recording."""
        return f"look at it with: rerun {shlex.quote(str(self.recording))}" if self.recording else ""

    @property
    def exit_code(self) -> ExitCode:
        """Whether it was interrupted."""
        return ExitCode.INTERRUPTED if self.interrupted else ExitCode.DONE


def summary_of(
    tracked: TrackedObject, counts: Counts, watch: Stopwatch, recordings: Sequence[Path], *, interrupted: bool
) -> RunSummary:
    """The summary of a run and of one of its objects."""
    reconstruction, collected = tracked.reconstruction, tracked.collected
    word = verdict(collected.course, reconstruction.map, few_bits(tracked.config.source), tracked.alike)
    rest, camera = reconstruction.rest, reconstruction.camera
    online = tracked.score(tracked.online)
    several = len(recordings) > 1
    return RunSummary(
        source=tracked.config.source,
        verdict=word.grade,
        verdict_reason=word.reason,
        frames=counts.frames,
        interrupted=interrupted,
        points=len(tracked.points_px),
        rest_shape=rest.kind if rest else None,
        rest_shape_note=rest.note if rest else None,
        bootstrap_frames=reconstruction.bootstrap_frames,
        deformation=reconstruction.deformation,
        metric=reconstruction.metric,
        priors=reconstruction.weights,
        focal_px=camera.focal_px if camera.perspective else None,
        focal_note=reconstruction.focal_note or None,
        mm_per_px=tracked.mm_per_px,
        branch_switches=collected.switches,
        reprojection_rms_px=collected.reprojection_rms_px,
        revisions=reconstruction.revisions,
        shapes="on-line" if tracked.online is None else "final pass",
        score=tracked.score(tracked.collected),
        e3d_online=online.e3d if online else None,
        visible_share=counts.visible_share,
        visible_share_last=counts.visible_share_last,
        objects=counts.objects,
        losses=counts.losses,
        recoveries=counts.recoveries,
        frames_lost=counts.frames_lost,
        fps=counts.frames / watch.elapsed_s,
        stage_ms={stage: total / max(counts.frames, 1) for stage, total in watch.total.items()},
        latency_ms=watch.latency_ms,
        recording=recordings[0] if recordings else None,
        parts=len(recordings) if several else None,
        last_part=recordings[-1] if several else None,
        own_parts=tuple(map(str, tracked.recordings)) if counts.objects > 1 and tracked.recordings else None,
    )
