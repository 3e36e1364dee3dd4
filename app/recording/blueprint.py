"""How a recording opens in the viewer; independent of what is in it, so that two recordings can share it."""

import rerun.blueprint as rrb

from app.recording import entities


def blueprint() -> rrb.Blueprint:
    """Mesh on the left, video with points and wireframe on the right, plots and texts below it.

    The recording moves its scene so that the mesh has unit size at the origin: the eye can be fixed here.
    """
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(
                name="Mesh",
                origin="/",
                # What the camera sees is a picture, not part of the scene; the camera itself is.
                contents=[f"+ /{entities.WORLD}/**", f"- /{entities.CAMERA}/**", f"+ /{entities.CAMERA}"],
                background=(24, 26, 32),
                line_grid=False,
                eye_controls=rrb.EyeControls3D(
                    kind=rrb.Eye3DKind.Orbital,
                    position=(0.9, -0.65, -4.2),
                    look_target=(0.0, 0.0, 0.0),
                    eye_up=(0.0, -1.0, 0.0),
                ),
            ),
            rrb.Vertical(
                rrb.Spatial2DView(
                    name="Video: seen (green), predicted (orange), lost (red)",
                    origin=entities.CAMERA,
                    contents="$origin/**",
                    background=(24, 26, 32),
                ),
                rrb.Tabs(
                    rrb.Vertical(
                        rrb.TimeSeriesView(
                            name="Reprojection error, px",
                            origin=entities.ERROR,
                            axis_x=rrb.TimeAxis(link="LinkToGlobal"),
                            axis_y=rrb.ScalarAxis(range=(0.0, 3.0)),
                        ),
                        rrb.TimeSeriesView(
                            name="Share of points seen",
                            origin=entities.VISIBLE,
                            axis_x=rrb.TimeAxis(link="LinkToGlobal"),
                            axis_y=rrb.ScalarAxis(range=(0.0, 1.05)),
                        ),
                        name="Quality",
                    ),
                    rrb.Horizontal(
                        rrb.TimeSeriesView(name="Leading coefficients, px", origin=entities.LEADING),
                        rrb.BarChartView(
                            name="This frame: Γα, Γβ, Γτ by mode",
                            origin=entities.SPECTRUM,
                            plot_legend=rrb.PlotLegend(visible=False),
                        ),
                        name="Coefficients",
                    ),
                    rrb.TimeSeriesView(name="Milliseconds per stage", origin=entities.TIMING),
                    rrb.TextLogView(name="Events", origin=entities.EVENTS),
                    rrb.Spatial2DView(name="Modes", origin=entities.MODES, background=(255, 255, 255)),
                    rrb.TextDocumentView(name="Configuration", origin=entities.CONFIGURATION),
                    rrb.TextDocumentView(name="Summary", origin=entities.SUMMARY),
                ),
                row_shares=[3, 2],
            ),
            column_shares=[1, 1],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=entities.FRAME),
        auto_layout=False,
        auto_views=False,
    )
