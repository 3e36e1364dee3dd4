"""Serves the page to this machine alone, and waits for what is drawn on it."""

import json
import secrets
import threading
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from app.picking.region import Picked, picked
from app.terminal.errors import UsageError

PAGE = Path(__file__).with_name("page.html")
MOST_BYTES = 100_000  # of what a page may send


@dataclass(frozen=True)
class About:
    """What the page is about: its name, how many frames there are, the first one to show, and whether it is live."""

    name: str
    frames: int | None
    first: int
    live: bool


class Picking:
    """A page on loopback; a context manager.

    Its address has a secret in it, so that no other page the browser shows can talk to it.

    Args:
        about: what it is about.
        picture: the JPEG of a frame, by its number; of a live source the newest. Called by one thread at a time.
        words: what is answered, of a region.
        port: 0 for any that is free.

    Attributes:
        url: its address.
    """

    def __init__(
        self, about: About, picture: Callable[[int], bytes], words: Callable[[Picked], str], port: int = 0
    ) -> None:
        self._secret = secrets.token_urlsafe(12)
        self._about, self._picture, self._words = about, picture, words
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._picked: Picked | None = None
        page = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                page._get(self)

            def do_POST(self) -> None:
                page._post(self)

            def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - as it is called
                """Nothing on the terminal."""

        try:
            self._server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        except OSError as error:
            raise UsageError(f"--port {port} cannot be used: {error.strerror}; leave it out for a free one") from error
        self.url = f"http://127.0.0.1:{self._server.server_port}/{self._secret}/"

    def __enter__(self) -> "Picking":
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()

    def wait(self) -> Picked:
        """What is drawn, once somebody is done."""
        while not self._ended.wait(0.2):  # so that Ctrl-C is heard
            pass
        assert self._picked is not None
        return self._picked

    def _get(self, request: BaseHTTPRequestHandler) -> None:
        address = urlsplit(request.path)
        if address.path == f"/{self._secret}/":
            answer(request, PAGE.read_bytes(), "text/html; charset=utf-8")
        elif address.path == f"/{self._secret}/info":
            answer(request, json.dumps(vars(self._about)).encode(), "application/json")
        elif address.path == f"/{self._secret}/frame":
            self._answer_frame(request, parse_qs(address.query).get("number", ["0"])[0])
        else:
            request.send_error(HTTPStatus.NOT_FOUND)

    def _answer_frame(self, request: BaseHTTPRequestHandler, number: str) -> None:
        try:
            with self._lock:
                content = self._picture(int(number))
        except ValueError as error:  # no number, or no such frame
            request.send_error(HTTPStatus.NOT_FOUND, str(error).splitlines()[0].encode("ascii", "replace").decode())
        else:
            answer(request, content, "image/jpeg")

    def _post(self, request: BaseHTTPRequestHandler) -> None:
        if request.path != f"/{self._secret}/done":
            request.send_error(HTTPStatus.NOT_FOUND)
            return
        length = min(int(request.headers.get("Content-Length") or 0), MOST_BYTES)
        try:
            found = picked(json.loads(request.rfile.read(length)))
        except (ValueError, KeyError, TypeError) as error:
            answer(request, str(error).encode(), "text/plain; charset=utf-8", HTTPStatus.BAD_REQUEST)
            return
        answer(request, self._words(found).encode(), "text/plain; charset=utf-8")
        self._picked = found
        self._ended.set()


def answer(request: BaseHTTPRequestHandler, content: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK) -> None:
    """Send a whole answer."""
    request.send_response(status)
    request.send_header("Content-Type", kind)
    request.send_header("Content-Length", str(len(content)))
    request.send_header("Cache-Control", "no-store")
    request.end_headers()
    request.wfile.write(content)
