"""Showing recordings in a viewer: one as it was recorded, two side by side."""

from pathlib import Path
from tempfile import NamedTemporaryFile

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk

from app.playback.measures import Reviewed
from app.playback.reading.chunks import ChunkFile
from app.recording import entities
from app.recording.blueprint import SLOW_MS, blueprint, curves, mesh_view, video_view

SIDES = ("left", "right")
COLORS = (((90, 170, 255), (160, 205, 255)), ((255, 140, 60), (255, 200, 160)))  # strong, pale


def show(reviewed: list[Reviewed], url: str) -> None:
    """Send one or two recordings to the viewer that listens at `url`.

    Two become one recording with an entity for each side, since a viewer shows one recording at a time.
    """
    two = len(reviewed) > 1
    stream = rr.RecordingStream(f"{entities.APPLICATION}-comparison" if two else entities.APPLICATION)
    layout = comparison([one.label for one in reviewed]) if two else blueprint()
    stream.set_sinks(rr.GrpcSink(url), default_blueprint=layout)
    stream.send_recording_name(" | ".join(one.label for one in reviewed))
    try:
        for one, side in zip(reviewed, SIDES, strict=False):
            with NamedTemporaryFile(suffix=".rrd") as part:
                for chunk in ChunkFile(one.playback.path, Path(part.name)):
                    if not chunk.entity_path.startswith("/__"):  # properties, as the name
                        rr.send_chunks(below(side, chunk) if two else chunk, recording=stream)
            if two:
                name_curves(stream, one, side)
        stream.flush()
    finally:
        stream.disconnect()


def name_curves(stream: rr.RecordingStream, one: Reviewed, side: str) -> None:
    """Name the curves after their recording, in its colours."""
    strong, pale = COLORS[one.place]
    curves = [(entities.ERROR, ["RMS", "median"], [pale, strong]), (entities.VISIBLE, ["seen"], [strong])]
    curves += [(f"{entities.TIMING}/{stage}", [stage], [strong]) for stage in one.playback.stage_ms]
    for entity, names, colors in curves:
        lines = rr.SeriesLines(names=[f"{name}, {one.label}" for name in names], colors=colors)
        stream.log(f"{side}/{entity}", lines, static=True)


def below(side: str, chunk: Chunk) -> Chunk:
    """A chunk below an entity."""
    return chunk.with_entity_path(f"/{side}/{chunk.entity_path.strip('/')}".rstrip("/"))


def comparison(names: list[str]) -> rrb.Blueprint:
    """Meshes and videos of two recordings beside each other, their plots in the same views."""
    sides = list(zip(names, SIDES, strict=True))
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(*(mesh_view(f"Mesh: {name}", f"/{side}") for name, side in sides)),
            rrb.Horizontal(*(video_view(f"Video: {name}", f"/{side}/{entities.CAMERA}") for name, side in sides)),
            rrb.Horizontal(
                curves("Reprojection error, px", "/", of=both_sides(entities.ERROR)),
                curves("Share of points seen", "/", of=both_sides(entities.VISIBLE)),
                curves("Milliseconds per stage", "/", (0.0, SLOW_MS), of=both_sides(entities.TIMING)),
            ),
            row_shares=[3, 3, 2],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=entities.FRAME, play_state="playing", loop_mode="all"),
        auto_layout=False,
        auto_views=False,
    )


def both_sides(entity: str) -> list[str]:
    """What is below an entity on both sides."""
    return [f"+ /{side}/{entity}/**" for side in SIDES]
