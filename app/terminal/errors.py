"""Mistakes in options and files, and the lines that report them.

The packages `tracking` and `reconstruction` know no options: their errors say what they are `about`, and the option that
helps is added here.
"""

REMEDIES = {
    "energy": "use --camera orthographic",
    "drop_late": "leave --drop-late out",
    "frames": "see --roi, --mask and --frames",
    "metric": "for instance --metric euclidean",
    "region": "check --roi",
    "rest_shape": "give --rest-shape solid: what turns later is found later; or --rest-shape plane or mesh.obj",
    "truth": "give it to --ground-truth",
}


class UsageError(ValueError):
    """An option or file that cannot be used; the message names it and the remedy."""


def in_a_line(error: BaseException) -> str:
    """What went wrong, with the options that it is about and that help.

    A message that begins with the setting it is about names the option instead: `modes 0 …` is `--modes 0 …`.
    """
    text, about = str(error), str(getattr(error, "about", ""))
    if about and text.startswith(f"{about} "):
        text = option(about) + text.removeprefix(about)
    return f"{text}; {REMEDIES[about]}" if about in REMEDIES else text


def option(field: str) -> str:
    """The option for a field of that name."""
    return "--" + field.replace("_", "-")
