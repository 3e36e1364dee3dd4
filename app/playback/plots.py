"""Figures of recordings, for paper and screen."""

from pathlib import Path
from typing import BinaryIO

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import AsinhNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from app.figures.chart_style import STYLE
from app.playback.facts import phase_ranges
from app.playback.measures import Reviewed
from app.terminal.errors import UsageError

FORMATS = (".png", ".pdf", ".svg")
COLORS = ("#0072B2", "#D55E00")  # of the first and the second recording; told apart by all eyes
STAGE_COLORS = ("#56B4E9", "#009E73", "#E69F00", "#CC79A7", "#999999")
BOOTSTRAP_COLOR, LOST_COLOR = "#eeeeee", "#fbdcdc"
ROWS = (r"$\Gamma_\alpha$", r"$\Gamma_\beta$", r"$\Gamma_\tau$")
DPI = 160
WIDTH_INCHES = 10.0


def check_format(path: Path) -> None:
    """Check that a figure can be written in the format that the file's name asks for.

    Raises:
        UsageError: an unknown one.
    """
    if path.suffix.lower() not in FORMATS:
        raise UsageError(f"--plot {path}: {path.suffix or 'no suffix'} is no format for figures: use {', '.join(FORMATS)}")


def write_review(file: BinaryIO, suffix: str, reviewed: list[Reviewed]) -> None:
    """Draw one recording, or two for comparison, in the format of a file suffix."""
    with mpl.rc_context({**STYLE, "lines.linewidth": 1.1, "svg.fonttype": "none"}):
        figure = review_figure(reviewed)
        figure.savefig(file, format=suffix.lower().lstrip("."), dpi=DPI)


def review_figure(reviewed: list[Reviewed]) -> Figure:
    """Error, share of the points seen, Λ and time over the frames, one below the other; at the right what has no frame."""
    shaped = [one for one in reviewed if one.playback.recorded_model is not None and one.playback.shaped.any()]
    maps = 3 * len(shaped)
    heights = [1.7, 1.0, *[0.95] * maps, 1.5]
    figure = Figure(figsize=(WIDTH_INCHES, 1.25 * sum(heights) + 0.3), layout="constrained")
    figure.suptitle(" versus ".join(one.label for one in reviewed), fontsize=10, x=0.01, ha="left")
    grid = figure.add_gridspec(len(heights), 3, width_ratios=[4, 0.12, 1], height_ratios=heights)  # a gap for the color bar
    over_frames = [figure.add_subplot(grid[row, 0]) for row in range(len(heights))]
    first, last = frame_range(reviewed)
    for axes in over_frames:
        axes.set_xlim(first - 0.5, last + 0.5)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.tick_params(labelbottom=axes is over_frames[-1])
    over_frames[-1].set_xlabel("frame")
    draw_error(over_frames[0], reviewed)
    draw_share(over_frames[1], reviewed)
    draw_time(over_frames[-1], reviewed)
    draw_stages(figure.add_subplot(grid[-1, 2]), reviewed)
    if shaped:
        draw_distribution(figure.add_subplot(grid[:2, 2]), shaped)
        draw_coefficients(over_frames[2:-1], shaped)
        draw_spectrum(figure.add_subplot(grid[2:5, 2]), shaped)
    return figure


def frame_range(reviewed: list[Reviewed]) -> tuple[int, int]:
    """First and last frame of all."""
    firsts = [int(one.playback.frames[0]) for one in reviewed]
    lasts = [int(one.playback.frames[-1]) for one in reviewed]
    return min(firsts), max(lasts)


def shade_phases(axes: Axes, reviewed: list[Reviewed]) -> None:
    """Mark the bootstrap and where the object was lost; not of two recordings, they would overlap."""
    if len(reviewed) > 1:
        return
    for name, first, last in phase_ranges(reviewed[0].playback):
        color = {"bootstrap": BOOTSTRAP_COLOR, "lost": LOST_COLOR}.get(name.lower())
        if color:
            axes.axvspan(first - 0.5, last + 0.5, color=color, linewidth=0, zorder=0)
            middle, place = (first + last) / 2, axes.get_xaxis_transform()  # x in frames, y from 0 to 1
            axes.text(middle, 0.95, name, transform=place, ha="center", va="top", fontsize=7, color="#777777")


def name_recordings(axes: Axes, reviewed: list[Reviewed]) -> None:
    """A legend beside the title, if there is anything to tell apart."""
    if len(reviewed) > 1:
        place_legend(axes)


def place_legend(axes: Axes) -> None:
    """A legend in the line of the title, where it hides nothing."""
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.2, columnspacing=1.2, handlelength=1.4
    )


def draw_error(axes: Axes, reviewed: list[Reviewed]) -> None:
    """Median with the 5th to 95th percentile, RMS dashed."""
    shade_phases(axes, reviewed)
    for playback, measured, label, place in reviewed:
        low, median, high = (measured.errors(q) for q in (5, 50, 95))
        axes.fill_between(playback.frames, low, high, color=COLORS[place], alpha=0.18, linewidth=0)
        axes.plot(playback.frames, median, color=COLORS[place], label=label)
        axes.plot(playback.frames, measured.rms_px, color=COLORS[place], linewidth=0.8, linestyle=(0, (3, 2)))
    axes.set_ylim(bottom=0)
    axes.set_ylabel("px")
    axes.set_title("Reprojection error: median, 5–95 % (band), RMS (dashed)")
    name_recordings(axes, reviewed)


def draw_share(axes: Axes, reviewed: list[Reviewed]) -> None:
    """Share of the points seen."""
    for playback, measured, _, place in reviewed:
        axes.plot(playback.frames, 100 * measured.visible_share, color=COLORS[place])
    lowest = 100 * min(float(measured.visible_share.min()) for _, measured, *_ in reviewed)
    axes.set_ylim(max(0.0, lowest - 0.15 * (102 - lowest)), 100 + 0.05 * (102 - lowest))
    axes.set_ylabel("%")
    axes.set_title("Points seen")


def draw_coefficients(maps: list[Axes], shaped: list[Reviewed]) -> None:
    """Λ over time: for each recording a map per row Γ, its modes downwards; one scale for all."""
    limit = max(float(np.nanmax(np.abs(playback.estimates.Lambda), initial=0.0)) for playback, *_ in shaped) or 1.0
    # Bending is far larger than stretching: the scale is linear only near zero, so that both show.
    scale = AsinhNorm(limit / 50, -limit, limit)
    for n, (playback, _, label, _) in enumerate(shaped):
        modes, name = playback.estimates.Lambda.shape[2], f" of {label}" if len(shaped) > 1 else ""
        edges = np.append(playback.frames - 0.5, playback.frames[-1] + 0.5)
        for k, row in enumerate(ROWS):
            axes, values = maps[3 * n + k], playback.estimates.Lambda[:, k].T
            image = axes.pcolormesh(edges, np.arange(modes + 1) + 0.5, values, cmap="RdBu_r", norm=scale, rasterized=True)
            axes.grid(visible=False)
            axes.set_ylim(modes + 0.5, 0.5)
            axes.set_yticks([1, *range(5, modes + 1, 5)] if modes > 5 else range(1, modes + 1))
            axes.set_ylabel(f"{row} mode")
            if k == 0:
                axes.set_title(f"Coefficients Λ{name}")
    bar = maps[2].figure.colorbar(image, cax=maps[2].inset_axes((1.012, 0.0, 0.012, 3.0)))
    bar.ax.set_in_layout(False)  # it would push the maps apart
    bar.ax.set_title("px (asinh)", loc="left", fontsize=7, fontweight="normal")
    tick = 10 ** np.floor(np.log10(limit))
    bar.set_ticks(
        [-tick, -tick / 10, 0, tick / 10, tick], labels=[f"{v:g}" for v in (-tick, -tick / 10, 0, tick / 10, tick)]
    )


def draw_time(axes: Axes, reviewed: list[Reviewed]) -> None:
    """Milliseconds a frame: of one recording by stage, stacked; of two their sums."""
    if len(reviewed) == 1:
        playback = reviewed[0].playback
        stages = list(playback.stage_ms.items())
        if stages:
            heights, colors = [np.nan_to_num(values) for _, values in stages], STAGE_COLORS[: len(stages)]
            axes.stackplot(playback.frames, heights, labels=[name for name, _ in stages], colors=colors, linewidth=0)
            place_legend(axes)
    else:
        for playback, measured, _, place in reviewed:
            axes.plot(playback.frames, measured.total_ms, color=COLORS[place], linewidth=0.8)
    totals = np.concatenate([measured.total_ms[np.isfinite(measured.total_ms)] for _, measured, *_ in reviewed])
    if totals.size:
        top = 1.15 * float(np.percentile(totals, 99))
        axes.set_ylim(0, top)
        slowest = max(reviewed, key=lambda one: float(np.nanmax(one.measured.total_ms, initial=0.0)))
        at = int(np.argmax(np.nan_to_num(slowest.measured.total_ms)))
        if slowest.measured.total_ms[at] > top:
            text, tip = f"{slowest.measured.total_ms[at]:.0f} ms", (slowest.playback.frames[at], top)
            axes.annotate(text, tip, (4, -3), textcoords="offset points", va="top", fontsize=7)
    axes.set_ylabel("ms")
    axes.set_title("Time per frame")


def draw_stages(axes: Axes, reviewed: list[Reviewed]) -> None:
    """Median milliseconds of each stage, with a line up to the 95th percentile."""
    names = list(dict.fromkeys(name for one in reviewed for name in one.playback.stage_ms))
    width = 0.8 / len(reviewed)
    for playback, _, _, place in reviewed:
        for k, name in enumerate(names):
            values = playback.stage_ms.get(name, np.empty(0))
            values = values[np.isfinite(values)]
            if values.size:
                median, high = np.percentile(values, (50, 95))
                color = STAGE_COLORS[k % len(STAGE_COLORS)] if len(reviewed) == 1 else COLORS[place]
                y = k + (place - (len(reviewed) - 1) / 2) * width
                axes.barh(y, median, 0.9 * width, color=color, xerr=[[0], [high - median]], error_kw={"lw": 0.8})
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("ms")
    axes.set_title("Median, 95th percentile")


def draw_distribution(axes: Axes, shaped: list[Reviewed]) -> None:
    """Which share of all points' reprojection errors is below a number of pixels."""
    percent = np.linspace(0, 100, 201)
    for _, measured, _, place in shaped:
        errors = measured.residual_px[np.isfinite(measured.residual_px)]
        if errors.size:
            axes.semilogx(np.maximum(np.percentile(errors, percent), 0.01), percent, color=COLORS[place])
    axes.set_ylim(0, 101)
    axes.set_xlabel("px")
    axes.set_title("% of errors below")


def draw_spectrum(axes: Axes, shaped: list[Reviewed]) -> None:
    """Eigenvalues of −½CDC, as shares of the first."""
    for playback, _, _, place in shaped:
        values = playback.basis.eigenvalues
        share = np.where(values > 0, values / values[0], np.nan)  # others have no logarithm
        style = {"color": COLORS[place], "marker": "os"[place], "markersize": 3, "linewidth": 0.8}
        axes.semilogy(np.arange(1, len(values) + 1), share, **style)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("mode")
    axes.set_title("Eigenvalues, relative")
