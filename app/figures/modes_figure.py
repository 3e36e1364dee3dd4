"""The mode shapes of a rest shape as a figure (paper's Fig. 2): each mode along each principal axis, and the spectrum."""

from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import TriMesh
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from app.arrays import Array, Indices
from app.recording.modes import MOVEMENT_RGB, View, brightness, displaced, normalised
from reconstruction.basis.distances import dissimilarity
from reconstruction.basis.mesh import Mesh, boundary
from reconstruction.basis.modal_basis import ModalBasis
from reconstruction.basis.modes import doubly_centred, exact_points
from reconstruction.settings import Metric

COLUMNS = 5
DPI, SMALL_DPI = 150, 100
PANEL_INCHES = 1.9
LEFT, SPECTRUM, TOP, BOTTOM = 1.25, 4.1, 0.85, 0.4  # inches around the panels
AXES_WORDS = (
    ("$\\Gamma_\\alpha$", "in the plane,\nlengthwise"),
    ("$\\Gamma_\\beta$", "in the plane,\nacross"),
    ("$\\Gamma_\\tau$", "out of\nthe plane"),
)
INK, FAINT, GHOST = "#22262e", "#8a919e", "#b9bfca"
MOVEMENT = LinearSegmentedColormap.from_list("movement", MOVEMENT_RGB / 255)


def spectrum(basis: ModalBasis, mesh: Mesh, metric: Metric) -> Array:
    """All eigenvalues (p,) of −½CDC, descending; of many points those of the basis, since D would not fit in memory."""
    if basis.rest.shape[1] > exact_points(metric):
        return basis.eigenvalues
    D = dissimilarity(metric, basis.rest, mesh.edges)
    return np.asarray(np.linalg.eigvalsh(doubly_centred(D))[::-1], np.float64)


def title_of(name: str, basis: ModalBasis, metric: str) -> str:
    """The figure's headline."""
    return f"Mode shapes of {name}: {basis.rest.shape[1]} points, {metric} distances"


def modes_figure(
    basis: ModalBasis, mesh: Mesh, eigenvalues: Array, *, title: str, columns: int = COLUMNS, jpeg: bool = False
) -> bytes:
    """The leading modes under Γ_α, Γ_β, Γ_τ (rows) and all `eigenvalues` (n,), descending, n >= r.

    Returns:
        a PNG, or a smaller picture as a JPEG.
    """
    columns = min(columns, len(basis.eigenvalues))
    view = View.three_quarter()
    length = float(np.ptp(basis.Phi[:, 0] @ basis.rest))
    frame = limits(basis, view, length, columns)
    panel = PANEL_INCHES * np.array([np.ptp(frame[0]), np.ptp(frame[1])]) / np.sqrt(np.ptp(frame[0]) * np.ptp(frame[1]))
    width, height = panel * (columns, 3) + (LEFT + SPECTRUM, TOP + BOTTOM)
    figure = Figure(figsize=(width, height), facecolor="white", dpi=SMALL_DPI if jpeg else DPI)
    FigureCanvasAgg(figure)

    def place(x: float, y: float, w: float, h: float) -> tuple[float, float, float, float]:
        return x / width, y / height, w / width, h / height

    rim = boundary(mesh.faces)
    for row, (symbol, words) in enumerate(AXES_WORDS):
        bottom = BOTTOM + (2 - row) * panel[1]
        for column in range(columns):
            axes = figure.add_axes(place(LEFT + column * panel[0], bottom, *panel))
            draw_mode(axes, basis, mesh, rim, view, row, column, length)
            axes.set(xlim=frame[0], ylim=frame[1])
            axes.set_axis_off()
            if row == 0:
                axes.set_title(f"mode {column + 1}", fontsize=11, color=INK, pad=2)
        x, y, *_ = place(0.18, bottom + panel[1] / 2, 0, 0)
        figure.text(x, y, symbol, fontsize=20, color=INK, va="bottom")
        figure.text(x, y - 0.06 / height, words, fontsize=8, color=FAINT, va="top", linespacing=1.3)
    right = LEFT + columns * panel[0]
    draw_spectrum(
        figure.add_axes(place(right + 0.75, BOTTOM + 0.35, SPECTRUM - 1.0, 3 * panel[1] - 0.45)),
        basis.eigenvalues,
        eigenvalues,
    )
    figure.text(0.18 / width, 1 - 0.3 / height, title, fontsize=13, color=INK, va="center")
    key = "color: the mode's value at a point, from negative (blue) to positive (red); gray: rest shape"
    figure.text(0.18 / width, 0.2 / height, key, fontsize=8, color=FAINT, va="center")
    picture = BytesIO()
    figure.savefig(picture, format="jpg" if jpeg else "png", pil_kwargs={"quality": 90} if jpeg else None)
    return picture.getvalue()


def limits(basis: ModalBasis, view: View, length: float, columns: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """What all panels show, so that their sizes can be compared."""
    shapes = [displaced(basis, axis, mode, length) for axis in range(3) for mode in range(columns)]
    points = np.concatenate([view.flat(shape) for shape in [basis.rest, *shapes]])
    margin = 0.02 * length
    (left, bottom), (right, top) = points.min(axis=0) - margin, points.max(axis=0) + margin
    return (left, right), (bottom, top)


def draw_mode(
    axes: Axes, basis: ModalBasis, mesh: Mesh, rim: Indices, view: View, axis: int, mode: int, length: float
) -> None:
    """One mode along one axis: a shaded surface over the outline of the rest shape."""
    faces, shape = mesh.faces, displaced(basis, axis, mode, length)
    points, rest = view.flat(shape), view.flat(basis.rest)
    lines(axes, rest[rim], GHOST, 0.9)
    colors = np.asarray(MOVEMENT(0.5 + 0.5 * normalised(basis.Upsilon[mode])))
    colors[:, :3] *= brightness(shape, faces, view)[:, None]
    depth = (view.axes[2] @ shape)[faces].mean(axis=1)
    # A triangulation's order is the order it is painted in: the farthest first.
    surface = TriMesh(Triangulation(points[:, 0], points[:, 1], faces[np.argsort(-depth)]))
    surface.set_facecolor(colors)  # type: ignore[arg-type]
    axes.add_collection(surface, autolim=False)
    lines(axes, points[mesh.edges], INK, 0.25, alpha=0.22)
    lines(axes, points[rim], INK, 0.6, alpha=0.7)


def lines(axes: Axes, ends: Array, color: str, width: float, alpha: float = 1.0) -> None:
    """Straight lines (n, 2, 2) as a single one with gaps: one by one they would take ten times as long."""
    gaps = np.full((len(ends), 1, 2), np.nan)
    x, y = np.concatenate([ends, gaps], axis=1).reshape(-1, 2).T
    axes.plot(x, y, color=color, linewidth=width, alpha=alpha, solid_capstyle="butt", zorder=1)


def draw_spectrum(axes: Axes, used: Array, eigenvalues: Array) -> None:
    """Eigenvalues of −½CDC on two logarithmic scales; those of the modes in use stand out."""
    positive = eigenvalues[eigenvalues > 1e-9 * eigenvalues[0]]
    axes.loglog(np.arange(1, len(positive) + 1), positive, color=GHOST, linewidth=1.6)
    axes.loglog(np.arange(1, len(used) + 1), used, "o", color="#c8502d", markersize=3.5)
    axes.set_title(f"eigenvalues ({len(used)} modes in use)", fontsize=11, color=INK, pad=8)
    axes.set_xlabel("mode", fontsize=9, color=FAINT)
    axes.tick_params(which="both", labelsize=8, colors=FAINT)
    axes.grid(which="major", color="#e6e8ec", linewidth=0.7)
    for side, line in axes.spines.items():
        line.set_visible(side in ("left", "bottom"))
        line.set_color(GHOST)
