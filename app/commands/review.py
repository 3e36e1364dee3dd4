"""`modeshape review`: what is in a recording, as a table, JSON, CSV, figure, or in the viewer; two for comparison."""

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import cast

from rich.console import Console
from rich.table import Table

from app.files.writing import check_free, writable
from app.options.run import Review, Words
from app.playback.measures import Reviewed, as_words, per_frame, reviewed
from app.playback.playback import Playback
from app.terminal.progress import Progress
from app.terminal.summary import as_json

# Parts of the configuration that have a row of their own, or say nothing about the result.
ELSEWHERE = ("source", "out", "overwrite", "tracks_out", "shapes_out", "view", "connect", "json")


def review(command: Review, progress: Progress) -> None:
    """Carry out the command.

    Raises:
        UsageError: a recording that cannot be read, a file that cannot be written, no viewer.
    """
    if command.plot:
        from app.playback.plots import check_format  # Matplotlib takes its time, and is not always wanted

        check_format(command.plot)
    for path in (command.csv, command.plot):
        check_free(path, overwrite=command.overwrite)
    url = None
    if command.connect:
        from app.recording.viewer import running_viewer

        url = running_viewer(command.connect)
    playbacks = [Playback.load(path) for path in (command.recording, command.other) if path is not None]
    for playback in playbacks:
        for note in playback.notes:
            progress.say(note)
    both = reviewed(playbacks)
    if command.csv:
        write_csv(command.csv, both)
    if command.plot:
        from app.playback.plots import write_review

        with writable(command.plot) as file:
            write_review(file, command.plot.suffix, both)
    words = [as_words(one.playback, one.measured) for one in both]
    if command.json:
        as_json(words[0] if len(words) == 1 else {"recordings": words})
    else:
        print_table(words)
    if url or command.view:
        from app.playback.comparison import show
        from app.recording.viewer import spawned_viewer

        show(both, url or spawned_viewer())


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


def print_table(words: list[Words]) -> None:
    """Facts by row, recordings by column, on stdout."""
    columns = [as_rows(one) for one in words]
    if len(words) == 2:
        columns = [shared_configuration(mine, other) for mine, other in zip(columns, reversed(columns), strict=True)]
    table = Table(title="modeshape review", show_header=False, title_justify="left", row_styles=["", "dim"])
    table.add_column(no_wrap=True)
    for _ in words:
        table.add_column(overflow="fold", ratio=1)
    for name in dict.fromkeys(name for column in columns for name in column):
        cells = [column.get(name, "") for column in columns]
        if any(cells):
            table.add_row(name, *cells)
    Console().print(table, highlight=False)


def as_rows(words: Words) -> dict[str, str]:
    """Facts as a person reads them, by label."""
    share = cast(Mapping[str, float], words["visible_share"])
    error = cast(Mapping[str, float] | None, words["reprojection_px"])
    stages = cast(Mapping[str, Mapping[str, float]], words["stage_ms"])
    phases = cast(list[Mapping[str, object]], words["phases"])
    worst = cast(list[Mapping[str, float]], words["worst_frames"])
    events = cast(list[Mapping[str, object]], words["events"])
    note = words["rest_shape_note"]
    rows = {
        "recording": str(words["recording"]),
        "source": known(words["source"]),
        "frames": f"{words['frames']} ({words['first_frame']} to {words['last_frame']}, {words['duration_s']:.2f} s), "
        f"{words['frames_with_shape']} with a shape",
        "phases": ", ".join(f"{p['phase']} {p['first']}–{p['last']}" for p in phases),
        "rest shape": known(words["rest_shape"]) + (f": {note}" if note else ""),
        "deformation": f"{known(words['deformation'])}, {words['modes']} modes of {known(words['metric'])} distances",
        "points": f"{words['points']}, {words['losses']} losses, {words['recoveries']} recoveries",
        "visible": f"{share['mean']:.1%} (lowest {share['min']:.1%}, last frame {share['last']:.1%})",
        "reprojection, px": named(error, ("mean", "median", "p95", "max", "rms"), "{:.3g}") if error else "",
        "worst frames, RMS px": ", ".join(f"{w['frame']} ({w['rms_px']:.2f})" for w in worst),
    }
    for stage, numbers in stages.items():
        rows[f"{stage}, ms"] = named(numbers, ("mean", "p95"), "{:.1f}")
    rows["fps"] = f"{words['fps']:.1f}" if words["fps"] else ""
    for name in ("e3d", "e3d_camera", "e3d_static", "e3d_sign_free"):
        rows[name] = f"{words[name]:.2%}" if words[name] is not None else ""
    rows["events"] = "\n".join(f"{e['frame']}: {e['text']}" for e in events if e["text"] != note)
    rows["notes"] = "\n".join(cast(list[str], words["notes"]))
    configuration = cast(Words, words["configuration"]).items()
    rows["configuration"] = "\n".join(f"{k} {v}" for k, v in configuration if v is not None and k not in ELSEWHERE)
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
