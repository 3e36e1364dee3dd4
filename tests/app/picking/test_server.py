"""What the page asks for, and who may ask."""

import json
import urllib.error
import urllib.request
from collections.abc import Iterator

import pytest

from app.picking.region import Picked, picked
from app.picking.server import About, Picking


def picture(number: int) -> bytes:
    if number > 3:
        raise ValueError("no such frame")
    return b"jpeg %d" % number


@pytest.fixture
def page() -> Iterator[Picking]:
    with Picking(About("a.mp4", 4, 0, False), picture, lambda found: " ".join(found.options)) as page:
        yield page


def get(url: str, body: object = None) -> bytes:
    data = None if body is None else json.dumps(body).encode()
    with urllib.request.urlopen(urllib.request.Request(url, data), timeout=10) as answer:
        content: bytes = answer.read()
        return content


def test_what_is_drawn_ends_it(page: Picking) -> None:
    assert b"<canvas" in get(page.url)
    assert json.loads(get(page.url + "info")) == {"name": "a.mp4", "frames": 4, "first": 0, "live": False}
    assert get(page.url + "frame?number=2&now=1") == b"jpeg 2"
    told = get(page.url + "done", {"kind": "roi", "points": [[90, 40], [10, 60]], "number": 2})
    assert told == b"--frames 2: --roi 10 40 80 20"
    assert page.wait() == Picked("roi", (10, 40, 80, 20), 2)


@pytest.mark.parametrize("path", ["frame?number=9", "frame?number=x", "nothing", "../info"])
def test_what_is_not_there(page: Picking, path: str) -> None:
    with pytest.raises(urllib.error.HTTPError, match="404"):
        get(page.url + path)


def test_only_who_knows_the_secret_is_answered(page: Picking) -> None:
    root = page.url.rsplit("/", 2)[0]
    for path in ("/", "/info", "/done"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            get(root + path, {"kind": "roi"} if path == "/done" else None)
    assert page.url.startswith("http://127.0.0.1:")


@pytest.mark.parametrize(
    "words",
    [
        {},
        {"kind": "roi", "points": [[1, 2]], "number": 0},
        {"kind": "corners", "points": [[1, 2]] * 5, "number": 0},
        {"kind": "circle", "points": [[1, 2]] * 3, "number": 0},
        {"kind": "polygon", "points": "abc", "number": 0},
        [],
    ],
)
def test_what_is_no_region(page: Picking, words: object) -> None:
    with pytest.raises(urllib.error.HTTPError, match="400"):
        get(page.url + "done", words)


def test_corners_as_options() -> None:
    found = picked({"kind": "polygon", "points": [[1, 2], [3, 4], [5, 6]], "number": 0})
    assert found.options == ["--polygon", "1", "2", "3", "4", "5", "6"]
