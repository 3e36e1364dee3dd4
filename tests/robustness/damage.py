"""What is done to inputs by the fuzzer: bytes, numbers, words and options, each by a random generator's seed."""

import io
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

Generator = np.random.Generator

MAGIC = {
    "mp4": b"\0\0\0\x18ftypmp42", "webm": b"\x1aE\xdf\xa3", "png": b"\x89PNG\r\n\x1a\n", "npz": b"PK\x03\x04",
    "rrd": b"RRF2", "glb": b"glTF\x02\0\0\0", "obj": b"v 1e999 nan 3\nf 1 2 -7\n",
}  # fmt: skip
VALUES = (
    "", "0", "-1", "1", "nan", "inf", "1e999", "99999999999999999999", "0.5", "a", "[red]", "[/]", "{}", "%s", "\udcff",
    "ä", "x" * 300, ".", "..", "/", "/dev/null", "/dev/full", "-", "--", "1 2 3 4", "10:5", ":", ":6", "'", "\\", "\n",
    "video.mp4", "run.rrd", "tracks.npz", "picture.png", "sheet.obj", "none.mp4", "none.rrd", "out.rrd", "o.glb", "o.npz",
    "o.mp4", "o.csv", "o", "10 10 200 200", "auto", "plane", "rigid", "orthographic", "rest=1", "obj",
)  # fmt: skip
INPUTS = {
    "run": "video.mp4", "frame": "video.mp4", "evaluate": "tracks.npz", "review": "run.rrd", "retexture": "run.rrd",
    "export": "run.rrd", "batch": "video.mp4", "modes": "run.rrd",
}  # fmt: skip
NEEDED = {
    "run": "--points 60 --modes 5 --frames :9 --no-final-pass --jobs 1 --out out.rrd",
    "frame": "--out o.png", "evaluate": "--modes 5", "review": "", "retexture": "--texture picture.png --out o.mp4",
    "export": "--format npz", "batch": "--out b --jobs 1", "modes": "--out o.png",
}  # fmt: skip
NEVER = (
    "--view",
    "--serve",
    "--connect",
    "--scheduler",
    "--help",
    "--help-all",
)  # wait for somebody, or are tried elsewhere


def bytes_changed(data: bytes, rng: Generator, suffix: str) -> tuple[str, bytes]:
    """What was done to a file, and what it is now."""
    array = np.frombuffer(data, np.uint8).copy()
    kind = rng.choice(["flips", "head flips", "cut", "zeros", "noise", "wrong header", "other kind", "twice", "empty"])
    if kind in ("flips", "head flips"):
        reach = len(array) if kind == "flips" else min(len(array), 400)
        for _ in range(int(rng.choice([1, 4, 30, 300]))):
            array[rng.integers(reach)] ^= np.uint8(1 << rng.integers(8))
    elif kind == "cut":
        array = array[: rng.integers(len(array))]
    elif kind in ("zeros", "noise"):
        start = int(rng.integers(len(array)))
        stop = start + int(rng.integers(1, len(array) // 3))
        array[start:stop] = 0 if kind == "zeros" else rng.integers(0, 256, len(array[start:stop]))
    elif kind == "wrong header":
        other = np.frombuffer(rng.choice(sorted(MAGIC.values())), np.uint8)
        array[: len(other)] = other[: len(array)]
    elif kind == "other kind":
        array = np.concatenate([np.frombuffer(MAGIC[suffix], np.uint8), rng.integers(0, 256, 3000).astype(np.uint8)])
    elif kind == "twice":
        array = np.concatenate([array, array[len(array) // 2 :]])
    else:
        array = array[:0]
    return str(kind), array.tobytes()


def set_some(values: NDArray[np.float64], value: float, rng: Generator) -> NDArray[np.float64]:
    """Some entries are this."""
    changed = values.copy()
    changed[rng.random(values.shape) < rng.choice([0.001, 0.1, 1.0])] = value
    return changed


NUMBERS: dict[str, Callable[[NDArray[np.float64], Generator], NDArray[np.generic]]] = {
    "nan": lambda a, rng: set_some(a, np.nan, rng),
    "inf": lambda a, rng: set_some(a, np.inf, rng),
    "huge": lambda a, rng: set_some(a, 10.0 ** rng.integers(5, 308), rng),
    "zero": lambda a, rng: set_some(a, 0.0, rng),
    "scaled": lambda a, rng: a * 10.0 ** rng.integers(-320, 150),
    "noise": lambda a, rng: a + rng.normal(0, 10.0 ** rng.integers(-3, 4), a.shape),
    "random": lambda a, rng: rng.normal(size=a.shape),
    "constant": lambda a, _: np.broadcast_to(a.reshape(-1)[:1], a.shape) if a.size else a,
    "mirrored": lambda a, _: -a,
    "swapped": lambda a, rng: a.swapaxes(*rng.integers(a.ndim, size=2)) if a.ndim else a,
    "shorter": lambda a, rng: a[: rng.integers(len(a))] if a.ndim else a,
    "flat": lambda a, _: a.reshape(-1),
    "first": lambda a, _: np.repeat(a[..., :1], a.shape[-1], axis=-1) if a.ndim else a,
    "whole": lambda a, _: np.nan_to_num(a, posinf=0, neginf=0).clip(-1e6, 1e6).astype(np.int8),
    "words": lambda a, _: a.astype("U8"),
    "complex": lambda a, _: a.astype(complex),
}


def numbers_changed(data: bytes, rng: Generator) -> tuple[str, bytes]:
    """One array of an .npz is something else, or missing."""
    with np.load(io.BytesIO(data)) as file:
        arrays = dict(file)
    name, kind = str(rng.choice(sorted(arrays))), str(rng.choice([*NUMBERS, "missing"]))
    array = arrays.pop(name)
    if kind != "missing":
        with np.errstate(all="ignore"):
            arrays[name] = NUMBERS[kind](array.astype(np.float64), rng)
    whole = io.BytesIO()
    np.savez(whole, **arrays)
    return f"{name} {kind}", whole.getvalue()


def words_changed(data: bytes, rng: Generator) -> tuple[str, bytes]:
    """Some words of a text file are others."""
    words = data.decode().split(" ")
    for place in rng.integers(len(words), size=rng.choice([1, 3, 30])):
        words[place] = str(rng.choice(["nan", "inf", "-1", "0", "1e999", "99999999", "1/1/1", "x", "\n", "f 1 1 1\n", ""]))
    return "words", " ".join(words).encode()


def picture_changed(_data: bytes, rng: Generator) -> tuple[str, bytes]:
    """Another picture, of any size, depth and channels."""
    height, width = (int(side) for side in rng.choice([1, 2, 3, 17, 300, 1500], size=2))
    channels, depth = int(rng.choice([1, 3, 4])), rng.choice([np.uint8, np.uint16])
    picture = rng.integers(0, np.iinfo(depth).max, (height, width, channels)).astype(depth)
    if rng.random() < 0.3:
        picture[:] = 0
    return f"{width}x{height}x{channels}", cv2.imencode(".png", picture)[1].tobytes()


def command_line(rng: Generator) -> list[str]:
    """A command with options, some of which make no sense."""
    from app.commands.cli import COMMANDS
    from app.terminal.pages import names

    name = str(rng.choice(list(INPUTS)))
    options = [option for option in names(COMMANDS[name][0]) if option not in NEVER]
    given = [INPUTS[name] if rng.random() < 0.8 else str(rng.choice(VALUES)), *NEEDED[name].split()]
    for _ in range(rng.integers(1, 4)):
        option, value = str(rng.choice(options)), str(rng.choice(VALUES))
        given += (
            [f"{option}={value}"] if rng.random() < 0.3 else [option, *value.split()] if rng.random() < 0.8 else [option]
        )
    if rng.random() < 0.1:
        rng.shuffle(given)
    return [name, *given]
