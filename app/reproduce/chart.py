"""Line charts of the report."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.figures.chart_style import STYLE

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
FAINT = "#8a919e"
DPI = 150
PANEL_INCHES = (4.6, 3.3)


@dataclass(frozen=True)
class Series:
    """A line; NaN and None where there is no value. Values of several seeds (n, k) become a line with a band."""

    label: str
    x: Sequence[float]
    y: Sequence[Sequence[float | None]] | Sequence[float | None]
    color: int = 0
    dashed: bool = False


@dataclass(frozen=True)
class Panel:
    """A chart: its lines, and what to compare with: levels (label, y) and points (label, x, y)."""

    title: str
    x_label: str
    y_label: str
    series: list[Series]
    levels: tuple[tuple[str, float], ...] = ()
    points: tuple[tuple[str, float, float], ...] = ()
    logarithmic: bool = False
    top: float | None = None


def charts(panels: list[Panel]) -> bytes:
    """The panels side by side as a PNG."""
    with mpl.rc_context(STYLE):
        width, height = PANEL_INCHES
        figure = Figure(figsize=(width * len(panels), height), layout="constrained")
        for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
            draw(axes, panel)
        picture = BytesIO()
        figure.savefig(picture, format="png", dpi=DPI)
    return picture.getvalue()


def draw(axes: Axes, panel: Panel) -> None:
    """One panel."""
    for series in panel.series:
        y = np.array(series.y, np.float64)
        y = y[:, None] if y.ndim == 1 else y
        known = np.isfinite(y).all(axis=1)
        x, y = np.asarray(series.x, np.float64)[known], y[known]
        color = COLORS[series.color % len(COLORS)]
        marker = "o" if len(x) < 25 else ""
        style = (0, (3, 2)) if series.dashed else "-"
        axes.plot(
            x, y.mean(axis=1), color=color, marker=marker, markersize=3.5, linewidth=1.3, ls=style, label=series.label
        )
        if y.shape[1] > 1:
            axes.fill_between(x, y.min(axis=1), y.max(axis=1), color=color, alpha=0.15, linewidth=0)
    for label, value in panel.levels:
        axes.axhline(value, color=FAINT, linewidth=0.9, linestyle=(0, (1, 1.5)))
        place = axes.get_yaxis_transform()  # x from 0 to 1, y in the data's units
        axes.text(1.0, value, label, transform=place, ha="right", va="bottom", fontsize=7.5, color=FAINT)
    for label, x_one, y_one in panel.points:
        axes.plot([x_one], [y_one], "*", color="#22262e", markersize=9, label=label, linestyle="none")
    if panel.logarithmic:
        axes.set_xscale("log")
        axes.set_yscale("log")
    else:
        axes.set_ylim(0, panel.top)
    axes.set(title=panel.title, xlabel=panel.x_label, ylabel=panel.y_label)
    if len(panel.series) > 1:
        axes.legend()
