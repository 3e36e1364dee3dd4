"""Showing recordings in a viewer: one as it was recorded, two side by side."""

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk

from app.playback.measures import Reviewed
from app.recording import entities
from app.recording.blueprint import blueprint

SIDES = ("left", "right")
COLORS = (((90, 170, 255), (160, 205, 255)), ((255, 140, 60), (255, 200, 160)))  # strong, pale
BACKGROUND = (24, 26, 32)
SLOW_MS = 100.0  # the end of the bootstrap takes far longer, and would flatten the rest


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
            for chunk in one.playback.file:
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
    plots = [
        ("Reprojection error, px", entities.ERROR, None),
        ("Share of points seen", entities.VISIBLE, None),
        ("Milliseconds per stage", entities.TIMING, (0.0, SLOW_MS)),
    ]
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(*(mesh_view(name, side) for name, side in zip(names, SIDES, strict=True))),
            rrb.Horizontal(*(video_view(name, side) for name, side in zip(names, SIDES, strict=True))),
            rrb.Horizontal(
                *(
                    rrb.TimeSeriesView(
                        name=title,
                        origin="/",
                        contents=[f"+ /{side}/{entity}/**" for side in SIDES],
                        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
                        axis_y=rrb.ScalarAxis(range=span),
                    )
                    for title, entity, span in plots
                )
            ),
            row_shares=[3, 3, 2],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=entities.FRAME),
        auto_layout=False,
        auto_views=False,
    )


def mesh_view(name: str, side: str) -> rrb.Spatial3DView:
    """The scene of one side, seen as in the blueprint of a single recording."""
    return rrb.Spatial3DView(
        name=f"Mesh: {name}",
        origin=f"/{side}",
        contents=[
            f"+ /{side}/{entities.WORLD}/**",
            f"- /{side}/{entities.CAMERA}/**",
            f"+ /{side}/{entities.CAMERA}",
        ],
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=(0.7, -0.5, -3.4),
            look_target=(0.0, 0.0, 0.0),
            eye_up=(0.0, -1.0, 0.0),
        ),
    )


def video_view(name: str, side: str) -> rrb.Spatial2DView:
    """The picture of one side with its points and wireframe."""
    origin = f"/{side}/{entities.CAMERA}"
    return rrb.Spatial2DView(name=f"Video: {name}", origin=origin, contents="$origin/**", background=BACKGROUND)
