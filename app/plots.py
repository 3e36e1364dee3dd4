"""Figures of recordings, for paper and screen."""

from pathlib import Path
from typing import BinaryIO

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from app.errors import UsageError
from app.measures import Measures, phase_ranges
from app.playback import Playback

FORMATS = (".png", ".pdf", ".svg")
COLORS = ("#0072B2", "#D55E00")  # of the first and the second recording; told apart by all eyes
STAGE_COLORS = ("#56B4E9", "#009E73", "#E69F00", "#CC79A7", "#999999")
BOOTSTRAP_COLOR, LOST_COLOR = "#eeeeee", "#fbdcdc"
ROWS = (r"$\Gamma_\alpha$", r"$\Gamma_\beta$", r"$\Gamma_\tau$")
STYLE = {
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.linewidth": 0.4,
    "grid.color": "#dddddd",
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "lines.linewidth": 1.1,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "svg.fonttype": "none",
}
DPI = 160
WIDTH_INCHES = 10.0

Reviewed = tuple[Playback, Measures]


def check_format(path: Path) -> None:
    """See to it that a figure can be written in the format that the file's name asks for.

    Raises:
        UsageError: an unknown one.
    """
    if path.suffix.lower() not in FORMATS:
        raise UsageError(f"--plot {path}: {path.suffix or 'no suffix'} is no format for figures: use {', '.join(FORMATS)}")


def write_review(file: BinaryIO, suffix: str, reviewed: list[Reviewed]) -> None:
    """Draw one recording, or two for comparison, in the format of a file suffix."""
    with mpl.rc_context(STYLE):
        figure = review_figure(reviewed)
        figure.savefig(file, format=suffix.lower().lstrip("."), dpi=DPI)


def review_figure(reviewed: list[Reviewed]) -> Figure:
    """Error, visible share and timing over the frames; Λ as a heat map; the eigenvalues' spectrum."""
    shaped = [r for r in reviewed if r[0].modelled is not None and r[0].shaped.any()]
    heights = [2.9, 2.9 * max(len(shaped), 1), 2.1]
    figure = Figure(figsize=(WIDTH_INCHES, sum(heights) + 0.4), layout="constrained")
    figure.suptitle(" versus ".join(playback.path.name for playback, _ in reviewed), fontsize=10, x=0.01, ha="left")
    over, maps, under = figure.subfigures(3, 1, height_ratios=heights)
    error, share = over.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    draw_error(error, reviewed)
    draw_share(share, reviewed)
    draw_maps(maps, shaped, frame_range(reviewed))
    timing, spectrum = under.subplots(1, 2, width_ratios=[2, 1])
    draw_timing(timing, reviewed)
    draw_spectrum(spectrum, shaped)
    for axes in (error, share, timing):
        axes.set_xlim(*frame_range(reviewed))
    return figure


def frame_range(reviewed: list[Reviewed]) -> tuple[int, int]:
    """First and last frame of all."""
    firsts = [int(playback.frames[0]) for playback, _ in reviewed]
    lasts = [int(playback.frames[-1]) for playback, _ in reviewed]
    return min(firsts), max(max(lasts), min(firsts) + 1)


def shade_phases(axes: Axes, reviewed: list[Reviewed]) -> None:
    """Mark the bootstrap and the frames in which the object was lost; of two recordings nothing, it would overlap."""
    if len(reviewed) > 1:
        return
    for name, first, last in phase_ranges(reviewed[0][0]):
        color = {"bootstrap": BOOTSTRAP_COLOR, "lost": LOST_COLOR}.get(name.lower())
        if color:
            axes.axvspan(first - 0.5, last + 0.5, color=color, linewidth=0, zorder=0)
            middle, place = (first + last) / 2, axes.get_xaxis_transform()  # x in frames, y from 0 to 1
            axes.text(middle, 0.97, name, transform=place, ha="center", va="top", fontsize=7, color="#777777")


def draw_error(axes: Axes, reviewed: list[Reviewed]) -> None:
    """Median with the 5th to 95th percentile, RMS dashed."""
    shade_phases(axes, reviewed)
    top = 0.0
    for (playback, measured), color in zip(reviewed, COLORS, strict=False):
        label = f"{playback.path.stem}: " if len(reviewed) > 1 else ""
        low, median, high = (measured.errors(q) for q in (5, 50, 95))
        axes.fill_between(playback.frames, low, high, color=color, alpha=0.18, linewidth=0, label=f"{label}5–95 %")
        axes.plot(playback.frames, median, color=color, label=f"{label}median")
        axes.plot(playback.frames, measured.rms_px, color=color, linewidth=0.8, linestyle=(0, (3, 2)), label=f"{label}RMS")
        if np.isfinite(high).any():
            top = max(top, float(np.nanmax(high)), float(np.nanmax(measured.rms_px)))
    axes.set_ylim(0, 1.15 * top if top > 0 else 1)
    axes.set_ylabel("px")
    axes.set_title("Reprojection error")
    axes.legend(ncols=3, loc="upper right")


def draw_share(axes: Axes, reviewed: list[Reviewed]) -> None:
    """Share of the points seen."""
    shade_phases(axes, reviewed)
    for (playback, measured), color in zip(reviewed, COLORS, strict=False):
        axes.plot(playback.frames, 100 * measured.visible_share, color=color, label=playback.path.stem)
    lowest = min(float(measured.visible_share.min()) for _, measured in reviewed)
    axes.set_ylim(0 if lowest < 0.6 else max(0.0, 100 * (lowest - 0.3 * (1.02 - lowest))), 101)
    axes.set_ylabel("%")
    axes.set_xlabel("frame")
    axes.set_title("Points seen")
    if len(reviewed) > 1:
        axes.legend(loc="lower right", ncols=2)


def draw_maps(figure: SubFigure, shaped: list[Reviewed], frames: tuple[int, int]) -> None:
    """Λ over time: for each recording a map per row Γ, its modes downwards; one scale for all."""
    if not shaped:
        axes = figure.subplots()
        axes.set_axis_off()
        axes.text(0.5, 0.5, "no shapes in this recording", ha="center", va="center", color="#777777")
        return
    values = np.concatenate([np.abs(playback.Lambda[playback.shaped]).ravel() for playback, _ in shaped])
    limit = float(np.percentile(values, 99.5)) or float(values.max()) or 1.0
    grid = figure.subplots(3 * len(shaped), 1, sharex=True, squeeze=False)[:, 0]
    for n, (playback, _) in enumerate(shaped):
        modes, name = playback.Lambda.shape[2], f", {playback.path.stem}" if len(shaped) > 1 else ""
        edges = np.append(playback.frames - 0.5, playback.frames[-1] + 0.5)
        for k, row in enumerate(ROWS):
            axes = grid[3 * n + k]
            image = axes.pcolormesh(
                edges,
                np.arange(modes + 1) + 0.5,
                playback.Lambda[:, k].T,
                cmap="RdBu_r",
                vmin=-limit,
                vmax=limit,
                rasterized=True,
            )
            axes.grid(visible=False)
            axes.set_ylim(modes + 0.5, 0.5)
            axes.set_yticks(sorted({1, *range(5, modes + 1, 5)} if modes > 5 else range(1, modes + 1)))
            axes.set_ylabel(f"{row}\nmode")
            if k == 0:
                axes.set_title(f"Coefficients Λ{name}")
    grid[0].set_xlim(*frames)
    grid[-1].set_xlabel("frame")
    figure.colorbar(image, ax=list(grid), label="px", extend="both", aspect=40, pad=0.01)


def draw_timing(axes: Axes, reviewed: list[Reviewed]) -> None:
    """Milliseconds a frame: of one recording by stage, stacked; of two their sums."""
    if len(reviewed) == 1:
        [(playback, measured)] = reviewed
        stages = sorted(playback.stage_ms.items(), key=lambda item: float(np.nanmean(item[1])))
        if stages:
            colors = [STAGE_COLORS[k % len(STAGE_COLORS)] for k in range(len(stages))]
            heights = [np.nan_to_num(values) for _, values in stages]
            labels = [f"{name} {np.nanmedian(values):.1f}" for name, values in stages]
            axes.stackplot(playback.frames, heights, labels=labels, colors=colors, linewidth=0)
    else:
        for (playback, measured), color in zip(reviewed, COLORS, strict=False):
            median = np.nanmedian(measured.total_ms) if np.isfinite(measured.total_ms).any() else np.nan
            label = f"{playback.path.stem} {median:.1f}"
            axes.plot(playback.frames, measured.total_ms, color=color, linewidth=0.8, label=label)
    totals = np.concatenate([measured.total_ms[np.isfinite(measured.total_ms)] for _, measured in reviewed])
    axes.set_ylim(0, 1.35 * float(np.percentile(totals, 99)) if totals.size else 1)
    axes.set_ylabel("ms")
    axes.set_xlabel("frame")
    axes.set_title("Time per frame (median in the legend)")
    if totals.size:
        axes.legend(ncols=4, loc="upper left")


def draw_spectrum(axes: Axes, shaped: list[Reviewed]) -> None:
    """Eigenvalues of −½CDC, as shares of the largest; what is not positive is left out of the logarithm."""
    for n, (playback, _) in enumerate(shaped):
        values = playback.basis.eigenvalues
        share = np.where(values > 0, values / values[0], np.nan)
        marker = ("o", "s")[n % 2]
        axes.semilogy(
            np.arange(1, len(values) + 1), share, color=COLORS[n % 2], marker=marker, markersize=3, label=playback.path.stem
        )
    axes.set_title("Eigenvalues, share of the first")
    axes.set_xlabel("mode")
    if len(shaped) > 1:
        axes.legend(loc="upper right")
