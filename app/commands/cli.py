"""The command line: parsed first, so that `--help` is instant; what it needs is imported afterwards."""

import contextlib
import io
import os
import re
import signal
import sys
from typing import Annotated, NoReturn

import tyro

from app.options.batch import Batch
from app.options.bench import Bench
from app.options.export import Export, Modes
from app.options.reproduce import Reproduce
from app.options.retexture import Retexture
from app.options.run import Demo, Evaluate, Review, Run
from app.recording.environment import environment
from app.terminal.errors import UsageError, in_a_line

Command = (
    Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    | Annotated[Demo, tyro.conf.subcommand("demo")]
    | Annotated[Review, tyro.conf.subcommand("review")]
    | Annotated[Retexture, tyro.conf.subcommand("retexture")]
    | Annotated[Export, tyro.conf.subcommand("export")]
    | Annotated[Batch, tyro.conf.subcommand("batch")]
    | Annotated[Modes, tyro.conf.subcommand("modes")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
)

DESCRIPTION = """One ordinary video of a deforming surface becomes a moving 3-D mesh, live.

Start with `modeshape demo`, then `modeshape run your_video.mp4 --roi X Y W H`."""

BAD_INPUT = 2
INTERRUPTED = 130


def main() -> NoReturn:
    """Entry point of the `modeshape` script; exit code 2 means that something asked for cannot be done."""
    os.environ.update(environment())
    try:
        sys.exit(run(parse()))
    except ValueError as error:
        if not is_ours(error):
            raise
        fail(in_a_line(error))
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


def parse() -> Run | Evaluate | Demo | Review | Retexture | Export | Modes | Batch | Reproduce | Bench:
    """The command asked for; a mistake is told in one line instead of a panel."""
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.cli(Command, prog="modeshape", description=DESCRIPTION, config=(tyro.conf.AvoidSubcommands,))
    except SystemExit as stop:
        if stop.code in (0, None):
            raise
        fail(in_one_line(complaint.getvalue()))


def in_one_line(panel: str) -> str:
    """What a panel of tyro's says, without frame, title, the parser's own names and the repeated help text."""
    rows = [row.strip("│| ") for row in re.sub(r"\x1b\[[0-9;]*m", "", panel).splitlines() if row.strip()[:1] in ("│", "|")]
    sections = [" ".join(part.split()) for part in re.split(r"[─-]{9,}", "\n".join(rows))]
    what = re.sub(r"^Error parsing \S+: (?=--)", "", sections[0].split(" Got errors:")[0]).rstrip(".")
    where = re.search(r"modeshape.* --help", sections[-1])
    return f"{what}; see {where.group() if where else 'modeshape --help'}"


def run(command: Run | Evaluate | Demo | Review | Retexture | Export | Modes | Batch | Reproduce | Bench) -> int:
    """Carry out a command; returns the exit code."""
    from app.terminal.progress import Progress
    from app.terminal.summary import as_json, as_table

    signal.signal(signal.SIGTERM, interrupt)
    if isinstance(command, Review):
        from app.commands.review import review

        review(command, Progress())
        return 0
    if isinstance(command, Batch):
        from app.commands.batch import batch

        return batch(command, Progress("starting"))
    if isinstance(command, Bench):
        from app.commands.bench import bench, print_tables

        words = bench(command, Progress("measuring"))
        (as_json if command.json else print_tables)(words)
        return 0
    if isinstance(command, Evaluate):
        from app.pipeline.evaluate import evaluate

        words, printed_as_json = evaluate(command, Progress()), command.json
    elif isinstance(command, Demo):
        from app.commands.demo import demo

        words, printed_as_json = demo(command), command.json
    elif isinstance(command, Retexture):
        from app.commands.retexture import retexture

        words, printed_as_json = retexture(command, Progress()), command.json
    elif isinstance(command, Export):
        from app.commands.export import export

        words, printed_as_json = export(command, Progress("reading")), command.json
    elif isinstance(command, Modes):
        from app.commands.modes import modes

        words, printed_as_json = modes(command, Progress("reading")), command.json
    elif isinstance(command, Reproduce):
        from app.commands.reproduce import reproduce, summary

        words, printed_as_json = reproduce(command), command.json
        words = words if printed_as_json else summary(words)
    else:
        from app.pipeline.session import Session

        words, printed_as_json = Session(command, Progress()).run().as_dict(), command.output.json
    if printed_as_json:
        as_json(words)
    else:
        as_table("modeshape", words)
        if words.get("recording"):
            sys.stderr.write(f"look at it with: rerun {words['recording']}\n")
    return INTERRUPTED if words.get("interrupted") else 0


def interrupt(_signum: int, _frame: object) -> NoReturn:
    """SIGTERM ends a run as Ctrl-C does: with everything so far kept."""
    raise KeyboardInterrupt


def is_ours(error: ValueError) -> bool:
    """Whether an error names the thing and the remedy, so that a traceback would only be in the way."""
    if isinstance(error, UsageError):
        return True
    from reconstruction import ReconstructionError
    from tracking import TrackingError

    return isinstance(error, ReconstructionError | TrackingError)


def fail(text: str) -> NoReturn:
    """One line on stderr, exit code 2."""
    sys.stderr.write(f"error: {text}\n")
    sys.exit(BAD_INPUT)
