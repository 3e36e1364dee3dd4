"""`modeshape review`: what is in a recording, as a table, JSON, CSV, figure, or in the viewer; two for comparison."""

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

from app.files.writing import check_outputs, writable
from app.options.review import Review
from app.playback.facts import Facts, facts
from app.playback.measures import Reviewed, per_frame, reviewed
from app.playback.playback import Playback
from app.terminal.progress import Progress
from app.terminal.streams import Tables
from app.terminal.summary import Summary

# Parts of the configuration that have a row of their own, or say nothing about the result.
ELSEWHERE = ("source", "out", "overwrite", "tracks_out", "shapes_out", "view", "connect", "json", "verbose")


@dataclass(frozen=True)
class Comparison(Summary):
    """The facts of one recording, or of two."""

    recordings: list[Facts]

    def as_dict(self) -> dict[str, object]:
        """Of one recording its facts alone."""
        each = [one.as_dict() for one in self.recordings]
        return each[0] if len(each) == 1 else {"recordings": each}

    def print_table(self) -> None:
        """Facts by row, recordings by column."""
        columns = [as_rows(one) for one in self.recordings]
        if len(columns) == 2:
            columns = [shared_configuration(mine, other) for mine, other in zip(columns, reversed(columns), strict=True)]
        table = Table(title="modeshape review", show_header=False, title_justify="left", row_styles=["", "dim"])
        table.add_column(no_wrap=True)
        for _ in columns:
            table.add_column(overflow="fold", ratio=1)
        for name in dict.fromkeys(name for column in columns for name in column):
            cells = [column.get(name, "") for column in columns]
            if any(cells):
                table.add_row(name, *cells)
        Tables().print(table)


def review(command: Review, progress: Progress) -> Comparison:
    """Carry out the command.

    Raises:
        UsageError: a recording that cannot be read, a file that cannot be written, no viewer.
    """
    if command.plot:
        from app.playback.plots import check_format  # Matplotlib takes its time, and is not always wanted

        check_format(command.plot)
    outputs = {"--csv": command.csv, "--plot": command.plot}
    check_outputs(outputs, (command.recording, command.other), overwrite=command.overwrite)
    url = None
    if command.connect:
        from app.recording.viewer import running_viewer

        url = running_viewer(command.connect)
    playbacks = [
        Playback.load(path, online=command.online) for path in (command.recording, command.other) if path is not None
    ]
    for playback in playbacks:
        for note in playback.notes:
            progress.log(note)
    both = reviewed(playbacks)
    if command.csv:
        write_csv(command.csv, both)
    if command.plot:
        from app.playback.plots import write_review

        with writable(command.plot) as file:
            write_review(file, command.plot.suffix, both)
    if url or command.view:
        from app.playback.comparison import show
        from app.recording.viewer import spawned_viewer

        show(both, url or spawned_viewer(progress.log))
    return Comparison([facts(one.playback, one.measured) for one in both])


def write_csv(path: Path, both: list[Reviewed]) -> None:
    """One row per frame and recording, under one heading; what is not known is empty.

    Raises:
        UsageError: the file cannot be written.
    """
    tables = [per_frame(one) for one in both]
    names = list(dict.fromkeys(name for table in tables for name in table))
    with writable(path) as file:
        text = io.TextIOWrapper(file, "utf-8", newline="", write_through=True)
        writer = csv.writer(text)
        writer.writerow(names)
        for table in tables:
            count = len(table["frame"])
            writer.writerows(zip(*(table.get(name, [None] * count) for name in names), strict=True))
        text.detach()


def as_rows(facts: Facts) -> dict[str, str]:
    """Facts as a person reads them, by label."""
    share, error, note = facts.visible_share, facts.reprojection_px, facts.rest_shape_note
    rows = {
        "verdict": f"{facts.verdict}: {facts.verdict_reason}" if facts.verdict else "",
        "recording": str(facts.recording),
        "source": known(facts.source),
        "frames": f"{facts.frames} ({facts.first_frame} to {facts.last_frame}, {facts.duration_s:.2f} s), "
        f"{facts.frames_with_shape} with a shape",
        "phases": ", ".join(f"{p['phase']} {p['first']}–{p['last']}" for p in facts.phases),
        "rest shape": known(facts.rest_shape) + (f": {note}" if note else ""),
        "deformation": f"{known(facts.deformation)}, {facts.modes} modes of {known(facts.metric)} distances",
        "points": f"{facts.points}, lost {facts.point_losses} times, seen again {facts.point_recoveries} times",
        "visible": f"{share['mean']:.1%} (lowest {share['min']:.1%}, last frame {share['last']:.1%})",
        "reprojection, px": named(error, ("mean", "median", "p95", "max", "rms"), "{:.3g}") if error else "",
        "worst frames, RMS px": ", ".join(f"{w['frame']} ({w['rms_px']:.2f})" for w in facts.worst_frames),
    }
    for stage, numbers in facts.stage_ms.items():
        rows[f"{stage}, ms"] = named(numbers, ("mean", "p95"), "{:.1f}")
    rows["fps"] = f"{facts.fps:.1f}" if facts.fps else ""
    for name in ("e3d", "e3d_camera", "e3d_static", "e3d_sign_free"):
        score = getattr(facts, name)
        rows[name] = f"{score:.2%}" if score is not None else ""
    rows["events"] = "\n".join(f"{e['frame']}: {e['text']}" for e in facts.events if e["text"] != note)
    rows["notes"] = "\n".join(facts.notes)
    told = [f"{k} {v}" for k, v in facts.configuration.items() if v is not None and k not in ELSEWHERE]
    rows["configuration"] = "\n".join(told)
    return {name: text for name, text in rows.items() if text}


def known(value: object) -> str:
    """A text, or a dash."""
    return "–" if value is None else str(value)


def named(values: Mapping[str, float], names: tuple[str, ...], form: str) -> str:
    """Numbers with their names."""
    return ", ".join(f"{name} {form.format(values[name])}" for name in names)


def shared_configuration(mine: dict[str, str], other: dict[str, str]) -> dict[str, str]:
    """The same rows, with the part of the configuration that differs from the other's."""
    theirs = other.get("configuration", "").split("\n")
    differing = [line for line in mine.get("configuration", "").split("\n") if line not in theirs]
    rows = {name: text for name, text in mine.items() if name != "configuration"}
    return rows | {"configuration that differs": "\n".join(differing)}
