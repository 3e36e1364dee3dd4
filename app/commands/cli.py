"""The command line: parsed first, so that `--help` is instant; what it needs is imported afterwards."""

import atexit
import contextlib
import io
import re
import signal
import sys
import warnings
from functools import reduce
from importlib import import_module
from operator import or_
from typing import Annotated, Any, NoReturn

import tyro

from app.memory import keep_memory
from app.options.batch import Batch
from app.options.bench import Bench
from app.options.evaluate import Evaluate
from app.options.export import Export
from app.options.modes import Modes
from app.options.pick import FramePicture, Pick
from app.options.reproduce import Reproduce
from app.options.retexture import Retexture
from app.options.review import Review
from app.options.run import Demo, Run
from app.terminal.arguments import meant, spelled_out
from app.terminal.errors import UsageError, in_a_line
from app.terminal.exit_code import ExitCode
from app.terminal.streams import prepare, standard_output

# Each command: its options, and the function that carries it out, given options and progress; it returns a summary.
COMMANDS: dict[str, tuple[type, str]] = {
    "run": (Run, "app.commands.run:run"),
    "pick": (Pick, "app.commands.pick:pick"),
    "frame": (FramePicture, "app.commands.pick:frame"),
    "evaluate": (Evaluate, "app.pipeline.evaluate:evaluate"),
    "demo": (Demo, "app.commands.demo:demo"),
    "review": (Review, "app.commands.review:review"),
    "retexture": (Retexture, "app.commands.retexture:retexture"),
    "export": (Export, "app.commands.export:export"),
    "batch": (Batch, "app.commands.batch:batch"),
    "modes": (Modes, "app.commands.modes:modes"),
    "reproduce": (Reproduce, "app.commands.reproduce:reproduce"),
    "bench": (Bench, "app.commands.bench:bench"),
}

ENDING = (signal.SIGTERM, signal.SIGHUP)

DESCRIPTION = """One ordinary video of a deforming surface becomes a moving 3-D mesh, live.

Start with `modeshape demo`, then `modeshape run your_video.mp4`, or
`modeshape pick your_video.mp4 --run` to draw where the surface is."""


def main() -> NoReturn:
    """Entry point of the `modeshape` script; see `ExitCode` for how it ends."""
    keep_memory()
    prepare()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of numbers: the verdict says what they are worth
            code = carry_out(parse(sys.argv[1:]))
            atexit.register(finish)
            sys.exit(code)
    except KeyboardInterrupt:
        atexit.register(finish)
        sys.exit(ExitCode.INTERRUPTED)
    except Exception as error:
        if isinstance(error, OSError) and error.filename is not None:
            fail(f"{error.filename}: {error.strerror}")
        if not is_ours(error):
            fail(unforeseen(error), ExitCode.OUR_MISTAKE)
        fail(in_a_line(error))


def parse(arguments: list[str]) -> Any:
    """The options of the command asked for; a mistake is told in one line instead of a panel.

    Raises:
        UsageError: a list of numbers that is none, or a name that is not UTF-8.
    """
    for argument in arguments:
        try:
            argument.encode()
        except UnicodeEncodeError:
            raise UsageError(f"{argument} is not UTF-8, which the names of files have to be here: rename it") from None
    kinds = {name: kind for name, (kind, _) in COMMANDS.items()}
    if arguments == ["--version"]:
        from importlib.metadata import version

        show(f"modeshape {version('modeshape')}\n")
    name = arguments[0] if arguments and arguments[0] in kinds else ""
    if not arguments or {"--help", "-h"} & set(arguments):
        from app.terminal.pages import overview, page

        show(page(name, kinds[name]) if name else overview(DESCRIPTION, kinds))
    everything = ["--help" if one == "--help-all" else one for one in spelled_out(arguments)]
    commands: Any = kinds.get(name)  # by itself: a parser of all takes its time to build
    if not name:
        commands = reduce(or_, [Annotated[kind, tyro.conf.subcommand(one)] for one, kind in kinds.items()])
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint), standard_output():
            return tyro.cli(
                commands,
                prog=f"modeshape {name}".rstrip(),
                args=everything[1:] if name else everything,
                description=None if name else DESCRIPTION,
                config=(tyro.conf.AvoidSubcommands,),
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            raise
        fail(with_hint(in_one_line(complaint.getvalue()), name))


def with_hint(complaint: str, name: str) -> str:
    """What tyro complains about, and what may have been meant; what a command is called does not begin with its options."""
    what, _, where = complaint.partition("; see ")
    where = f"modeshape {name} --help".replace("  ", " ")
    if what.startswith("Unrecognized options: "):
        from app.terminal.pages import names

        unknown = what.removeprefix("Unrecognized options: ").split(", ")
        what = f"there is no {unknown[0]}" if unknown[0].startswith("-") else f"not understood: {' '.join(unknown)}"
        hint = meant(unknown, names(COMMANDS[name][0]) if name else (), COMMANDS)
        return f"{what}: {hint}" if hint else f"{what}; see {where}"
    return f"{what}; see {where}"


def show(text: str) -> NoReturn:
    """Print, and end."""
    with standard_output():
        sys.stdout.write(text)
    sys.exit(ExitCode.DONE)


def in_one_line(panel: str) -> str:
    """What a panel of tyro's says, without frame, title, the parser's own names and the repeated help text."""
    rows = [row.strip("│| ") for row in re.sub(r"\x1b\[[0-9;]*m", "", panel).splitlines() if row.strip()[:1] in ("│", "|")]
    sections = [" ".join(part.split()) for part in re.split(r"[─-]{9,}", "\n".join(rows))]
    what = re.sub(r"^Error parsing (?:\S+: (?=--)|[A-Z]\w*: )", "", sections[0].split(" Got errors:")[0]).rstrip(".")
    where = re.search(r"modeshape.* --help", sections[-1])
    return f"{what}; see {where.group() if where else 'modeshape --help'}"


def carry_out(options: Any) -> ExitCode:
    """Call the command's function and print its summary."""
    from app.terminal.progress import Progress
    from app.terminal.summary import Summary

    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup does
            signal.signal(number, interrupt)
    module, function = next(place for kind, place in COMMANDS.values() if kind is type(options)).split(":")
    summary: Summary = getattr(import_module(module), function)(options, Progress())
    with standard_output():
        if options.json:
            sys.stdout.write(summary.as_json() + "\n")
        else:
            summary.print_table() if options.verbose else summary.print_short()
    if summary.hint and not options.json:
        sys.stderr.write(f"{summary.hint}\n")
    return summary.exit_code


def interrupt(_signum: int, _frame: object) -> NoReturn:
    """A signal ends a run as Ctrl-C does: with everything so far kept."""
    raise KeyboardInterrupt


def finish() -> None:
    """Further signals say nothing new: all is written, and the exit code is to say that it was interrupted."""
    for number in (signal.SIGINT, *ENDING):
        signal.signal(number, signal.SIG_IGN)


def is_ours(error: Exception) -> bool:
    """Whether an error names the thing and the remedy, so that a traceback would only be in the way."""
    if isinstance(error, UsageError):
        return True
    from reconstruction import ReconstructionError
    from tracking import TrackingError

    return isinstance(error, ReconstructionError | TrackingError)


def unforeseen(error: Exception) -> str:
    """What nobody has thought of, in a line; where it happened is in a file."""
    import tempfile
    import traceback

    told = f"{type(error).__name__}: {' '.join(str(error).split())}"
    if isinstance(error, MemoryError):
        told = "the memory is full"
    if "--verbose" in sys.argv:
        sys.stderr.write(traceback.format_exc())
        return told
    try:
        with tempfile.NamedTemporaryFile("w", prefix="modeshape-", suffix=".txt", delete=False, errors="replace") as file:
            file.write(f"modeshape {sys.argv[1:]}\n\n{traceback.format_exc()}")
    except OSError:
        return f"{told}; --verbose shows where"
    return f"{told}; where it happened is in {file.name}"


def fail(text: str, code: ExitCode = ExitCode.BAD_INPUT) -> NoReturn:
    """One line on stderr, and the end."""
    sys.stderr.write(f"error: {' '.join(text.splitlines())}\n")
    sys.exit(code)
