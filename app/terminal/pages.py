"""What `--help` shows: an example first, then the options that most people need, on one screen."""

import ast
import inspect
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import Field, fields, is_dataclass
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from app.terminal.arguments import NUMBERS

WIDTH, MOST_LINES = 80, 40
INDENT = 26


def page(name: str, kind: type) -> str:
    """The help of a command, by the dataclass of its options.

    Its docstring may have a section Examples; what else it tells is shown if there is room. Of a field's docstring the
    first sentence is shown. `ESSENTIAL` names the fields that are shown, if there are more than fit.
    """
    text, _, examples = inspect.cleandoc(kind.__doc__ or "").partition("Examples:\n")
    shown = getattr(kind, "ESSENTIAL", ())
    every = sorted(options(kind), key=lambda one: one[0].startswith("-"))
    chosen = [one for one in every if not shown or field_name(one[0]) in shown]
    head = ["Examples:", *(examples or f"  modeshape {name}").rstrip().splitlines(), ""]
    left = len(every) - len(chosen)
    tail = ["", f"All {len(every)} options: modeshape {name} --help-all" if left else f"More: modeshape {name} --help-all"]
    tail = [line for form, told in chosen for line in entry(form, told)] + tail
    whole, first = wrapped(text), wrapped(text.split("\n\n")[0])
    room = len(head) + len(whole) + 1 + len(tail) <= MOST_LINES
    return "\n".join([*head, *(whole if room else first), "", *tail]) + "\n"


def wrapped(text: str) -> list[str]:
    """Paragraphs as lines that fit; lists, which are indented, stay lists."""
    lines: list[str] = []
    for part in text.strip().split("\n\n"):
        items = part.splitlines() if "\n  " in part else [" ".join(part.split())]
        for item in items:
            indent = " " * (len(item) - len(item.lstrip()))
            lines += textwrap.wrap(
                item.strip(), WIDTH, initial_indent=indent, subsequent_indent=indent + " " * 7 * bool(indent)
            )
        lines.append("")
    return lines[:-1]


def entry(form: str, told: str) -> list[str]:
    """An option and what it does; a long one has a line of its own."""
    indent = " " * INDENT
    lines = textwrap.wrap(told, WIDTH, initial_indent=indent, subsequent_indent=indent)
    begun = f"  {form}"
    return [begun, *lines] if len(begun) > INDENT - 2 or not lines else [f"{begun:{INDENT}}{lines[0].strip()}", *lines[1:]]


def field_name(form: str) -> str:
    """`roi` of `--roi X Y WIDTH HEIGHT`."""
    return form.split()[0].removeprefix("--").replace("-", "_").lower()


def overview(description: str, commands: Mapping[str, type]) -> str:
    """The help of the program."""
    lines = [description, ""]
    for name, kind in commands.items():
        told = first_sentence(inspect.cleandoc(kind.__doc__ or ""))
        lines += textwrap.wrap(told, WIDTH, initial_indent=f"  {name:11} ", subsequent_indent=" " * 14)
    return "\n".join([*lines, "", "Each has its own help: modeshape COMMAND --help"]) + "\n"


def options(kind: type) -> Iterator[tuple[str, str]]:
    """Each option as it is typed, and its first sentence; those of groups, too."""
    hints = get_type_hints(kind, include_extras=True)
    told = explained(kind)
    for field in fields(kind):
        inner = unannotated(hints[field.name])
        if is_dataclass(inner):
            yield from options(inner)  # type: ignore[arg-type]
        elif "Suppress" not in repr(hints[field.name]):
            form, sentence = form_of(field, hints[field.name]), first_sentence(told.get(field.name, ""))
            yield form, f"Do not: {sentence[:1].lower()}{sentence[1:]}" if form.startswith("--no-") else sentence


def names(kind: type) -> list[str]:
    """The options of a command, as they are typed."""
    return [form.split()[0] for form, _ in options(kind) if form.startswith("--")]


def form_of(field: "Field[Any]", hint: object) -> str:
    """`--roi X Y WIDTH HEIGHT`, or `VIDEO` for what has no name."""
    name = f"--{field.name.replace('_', '-')}"
    if "Positional" in repr(hint) or any("Positional" in repr(one) for one in getattr(hint, "__metadata__", ())):
        return field.name.upper()
    inner = unannotated(hint)
    if name in NUMBERS:
        return f"{name} {NUMBERS[name].names}"
    if inner is bool:
        return name if field.default is not True else f"--no-{name[2:]}"
    metavars = [one.metavar for one in getattr(hint, "__metadata__", ()) if getattr(one, "metavar", None)]
    if metavars:
        return f"{name} {metavars[0]}"
    kinds = get_args(inner) if get_origin(inner) in (Union, UnionType) else (inner,)
    return f"{name} {'|'.join(word for one in kinds for word in words(one))}"


def words(kind: Any) -> list[str]:
    """What may be given for a type."""
    if get_origin(kind) is Literal:
        return [str(choice) for choice in get_args(kind)]
    plain = {int: "N", float: "NUMBER", str: "TEXT", type(None): ""}.get(kind, "PATH")
    return [plain] if plain else []


def unannotated(hint: Any) -> Any:
    """A type without what is noted about it."""
    return hint.__origin__ if hasattr(hint, "__metadata__") else hint


def explained(kind: type) -> dict[str, str]:
    """The docstrings of a dataclass's fields, also of those it inherits, by name."""
    told: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if not is_dataclass(base) or base is object:
            continue
        body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0]
        assert isinstance(body, ast.ClassDef)
        for one, after in zip(body.body, body.body[1:], strict=False):
            if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name) and is_text(after):
                told[one.target.id] = " ".join(ast.literal_eval(after.value).split())  # type: ignore[attr-defined]
    return told


def is_text(node: ast.stmt) -> bool:
    """Whether a statement is a docstring."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def first_sentence(text: str) -> str:
    """Up to the first full stop, colon or semicolon that is followed by a space or the end."""
    flat = " ".join(text.split("\n\n")[0].split())
    for k, letter in enumerate(flat):
        if letter in ".;" and flat[k + 1 : k + 2] in ("", " "):
            return flat[:k]
    return flat
