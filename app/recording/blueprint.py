"""How a recording opens in the viewer; independent of what is in it, so that two recordings can share it."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from app.recording import entities

BACKGROUND = (24, 26, 32)
FLOOR = 1.7  # below the mesh, which has unit size
SLOW_MS = 60.0  # where the axis of the stages' times ends: a single slow frame must not flatten the others


def blueprint(*, live: bool = False) -> rrb.Blueprint:
    """Mesh and its relief on the left, video with points and wireframe on the right, plots and texts below it.

    The recording moves its scene so that the mesh has unit size at the origin: the eyes can be fixed here. A file plays
    from its first frame, again and again; of a run that goes on the newest frame is shown.
    """
    playing: Literal["following", "playing"] = "following" if live else "playing"
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                mesh_view("Mesh, from where the camera is", "/"),
                rrb.Spatial3DView(
                    name="From the side: near (blue) to far (red), or what was asked for",
                    origin="/",
                    contents=[f"+ /{entities.MESH}", f"+ /{entities.CAMERA}", f"+ /{entities.TRUTH}"],
                    overrides={entities.MESH: untextured()},
                    background=BACKGROUND,
                    line_grid=grid(),
                    eye_controls=eye((3.4, -2.3, -2.6)),
                ),
                row_shares=[3, 2],
            ),
            rrb.Vertical(
                video_view("Video: seen (green), predicted (orange), lost (red)", f"/{entities.CAMERA}"),
                rrb.Tabs(
                    rrb.TextDocumentView(name="What you see", origin=entities.HELP),
                    rrb.Vertical(
                        curves("Reprojection error, px", entities.ERROR),
                        curves("Share of points seen", entities.VISIBLE, (0.0, 1.05)),
                        name="Quality",
                    ),
                    rrb.Horizontal(
                        curves("How it deforms: leading modes, px", entities.LEADING),
                        rrb.BarChartView(
                            name="This frame, by mode: lengthwise α, across β, bending τ",
                            origin=entities.SPECTRUM,
                            plot_legend=rrb.PlotLegend(visible=False),
                        ),
                        name="Deformation",
                    ),
                    rrb.Spatial3DView(
                        name="Modes: bending",
                        origin=f"/{entities.MODES}",
                        background=BACKGROUND,
                        line_grid=False,
                        eye_controls=eye((0.0, 0.0, -1.6)),
                    ),
                    curves("Milliseconds per stage", entities.TIMING, (0.0, SLOW_MS)),
                    rrb.TextLogView(
                        name="Events",
                        origin=entities.EVENTS,
                        columns=rrb.TextLogColumns(
                            timeline_columns=[entities.FRAME, entities.TIME], text_log_columns=["loglevel", "body"]
                        ),
                    ),
                    rrb.TextDocumentView(name="Summary", origin=entities.SUMMARY),
                    rrb.TextDocumentView(name="Configuration", origin=entities.CONFIGURATION),
                ),
                row_shares=[3, 2],
            ),
            column_shares=[1, 1],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=entities.FRAME, play_state=playing, loop_mode="off" if live else "all"),
        auto_layout=False,
        auto_views=False,
    )


def mesh_view(name: str, origin: str) -> rrb.Spatial3DView:
    """The textured mesh, seen nearly as the camera sees it, and what there is before there is one."""
    below = origin.rstrip("/")
    return rrb.Spatial3DView(
        name=name,
        origin=origin,
        contents=[f"+ {below}/{entities.MESH}", f"+ {below}/{entities.STATUS}"],
        overrides={f"{below}/{entities.MESH}": untinted()},
        background=BACKGROUND,
        line_grid=False,
        eye_controls=eye((0.9, -0.65, -4.2)),
    )


def video_view(name: str, origin: str) -> rrb.Spatial2DView:
    """The picture with its points and wireframe."""
    return rrb.Spatial2DView(name=name, origin=origin, contents="$origin/**", background=BACKGROUND)


def curves(
    name: str, origin: str, span: tuple[float, float] | None = None, *, of: Sequence[str] = ("$origin/**",)
) -> rrb.TimeSeriesView:
    """Numbers over time; without a span the axis is as long as they need."""
    x, y = rrb.TimeAxis(link="LinkToGlobal"), rrb.ScalarAxis(range=span) if span else None
    return rrb.TimeSeriesView(name=name, origin=origin, contents=list(of), axis_x=x, axis_y=y)


def eye(position: tuple[float, float, float]) -> rrb.EyeControls3D:
    """One that looks at the origin."""
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=position, look_target=(0.0, 0.0, 0.0), eye_up=(0.0, -1.0, 0.0)
    )


def grid() -> rrb.LineGrid3D:
    """A floor."""
    return rrb.LineGrid3D(plane=rr.components.Plane3D((0, 1, 0), FLOOR), spacing=0.5, color=(70, 74, 84))


def untinted() -> rr.Mesh3D:
    """A mesh that shows its texture, and not its vertices' colours."""
    return rr.Mesh3D.from_fields(vertex_colors=[0xFFFFFFFF])


def untextured() -> rr.Mesh3D:
    """A mesh that shows its vertices' colours, and not its texture."""
    return rr.Mesh3D.from_fields(
        albedo_texture_buffer=np.full(3, 255, np.uint8).tobytes(),
        albedo_texture_format=rr.components.ImageFormat(1, 1, color_model="RGB", channel_datatype="U8"),
    )
