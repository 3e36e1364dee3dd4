"""What the ratios should be, and how they are put in words."""

from collections.abc import Mapping
from dataclasses import dataclass

Ratios = Mapping[str, float | None]


@dataclass(frozen=True)
class Target:
    """One figure that should stay on one side of a limit."""

    name: str
    what: str
    limit: float
    at_least: bool = False
    unit: str = "×"

    def met(self, value: float) -> bool:
        """Whether the figure is on the right side."""
        return value >= self.limit if self.at_least else value <= self.limit

    @property
    def wanted(self) -> str:
        """The limit in words."""
        return f"{'≥' if self.at_least else '≤'} {figure(self.limit)}{spaced(self.unit)}"


TARGETS = (
    Target("scipy_over_ours", "Window step, 828 points, 30 modes, general: SciPy's time over ours", 100, at_least=True),
    Target("ceres_over_ours", "the same: Ceres' time over ours", 10, at_least=True),
    Target("iteration_spread", "Solver iteration: longest over shortest, of all numbers of points", 1.2),
    Target("statistics_over_dgemm", "Summing up 828 points over one matrix product of that size", 1.5),
    Target("statistics_over_dgemm_largest", "the same with the most points", 1.5),
    Target("growth_with_points", "Window step: power of the number of points it grows with", 1, unit=""),
    Target("euclidean_28887_s", "Basis of 28,887 points, 30 modes, straight distances", 10, unit="s"),
    Target("manhattan_28887_s", "the same, along the mesh", 10, unit="s"),
    Target("euclidean_28887_mb", "its memory, straight distances", 2048, unit="MB"),
    Target("manhattan_28887_mb", "the same, along the mesh", 2048, unit="MB"),
    Target("angle_deg_euclidean", "Its first 10 modes to the exact ones, at 3,024 points, straight distances", 5, unit="°"),
    Target("angle_deg_manhattan", "the same, along the mesh", 5, unit="°"),
    Target("wall_over_bare_kinect_paper_800", "Run of kinect_paper, 800 points, over the bare OpenCV loop", 1.25),
    Target("wall_over_bare_demo_800", "Run of the demo, 800 points, over the bare OpenCV loop", 1.25),
    Target("fps_kinect_paper_800", "Frames a second, kinect_paper, 640×480, 800 points", 60, at_least=True, unit=""),
    Target("fps_demo_800", "the same, demo", 70, at_least=True, unit=""),
    Target("core_ms_kinect_paper_800", "Processor time a frame, all processes, kinect_paper", 15, unit="ms"),
    Target("core_ms_demo_800", "the same, demo", 15, unit="ms"),
    Target("core_over_bare_kinect_paper_800", "the same over the bare OpenCV loop's, kinect_paper", 2),
    Target("latency_ms_kinect_paper_800", "From frame to mesh, median, kinect_paper from a file", 35, unit="ms"),
    Target("memory_mb_kinect_paper_800", "Memory of all processes, kinect_paper", 450, unit="MB"),
    Target("drift_px_kinect_paper_800", "Tracked points from the truth, median, kinect_paper", 0.3, unit="px"),
    Target("p95_over_median_kinect_paper_800", "Frame times, kinect_paper: 95th percentile over median", 2),
    Target("p95_over_median_demo_800", "the same, demo", 2),
    Target("unwritten_s_kinect_paper_800", "Longest that nothing of it is written, kinect_paper", 2, unit="s"),
    Target("unwritten_s_demo_800", "the same, demo", 2, unit="s"),
    Target("paint_ms", "Painting a picture on 800 points, 640×480, one core", 1000 / 60, unit="ms"),
    Target("help_s", "modeshape --help", 0.3, unit="s"),
    Target("first_frame_s", "First frame done after the command", 0.6, unit="s"),
)


def rows(ratios: Ratios) -> list[tuple[str, str, str, bool]]:
    """What, figure, wanted, met; of everything that was measured."""
    table = []
    for target in TARGETS:
        value = ratios.get(target.name)
        if value is not None:
            table.append((target.what, f"{figure(value)}{spaced(target.unit)}", target.wanted, target.met(value)))
    return table


def markdown(ratios: Ratios, machine: str) -> str:
    """The table for the README."""
    lines = ["| measured | figure | target |", "|---|---:|---:|"]
    lines += [f"| {what} | {value}{'' if met else ' (missed)'} | {wanted} |" for what, value, wanted, met in rows(ratios)]
    return "\n".join(["", *lines, "", machine, "", ""])


def figure(value: float) -> str:
    """Three digits."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def spaced(unit: str) -> str:
    """A unit as it follows a number."""
    return unit if unit in ("", "×", "°") else f" {unit}"
