"""A camera on the network: MJPEG over HTTP, its frames numbered in the picture."""

import threading
import time
from collections.abc import Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

BITS, BLOCK_PX = 16, 16
RATE = 60.0


def numbered(picture: Image, number: int) -> Image:
    """A picture with a number in black and white blocks along its top."""
    picture = picture.copy()
    for bit in range(BITS):
        picture[:BLOCK_PX, bit * BLOCK_PX : (bit + 1) * BLOCK_PX] = 255 * (number >> bit & 1)
    return picture


def number_in(picture: Image) -> int:
    """The number that `numbered` put there."""
    middle = BLOCK_PX // 2
    return sum(1 << bit for bit in range(BITS) if picture[middle, bit * BLOCK_PX + middle].mean() > 127)


class Camera:
    """Serves pictures over and over, 60 a second, on 127.0.0.1; a context manager.

    Attributes:
        port: kept over `stop` and `start`.
    """

    def __init__(self, pictures: Sequence[Image]) -> None:
        self._pictures = pictures
        self._began = time.monotonic()
        self.port = 0
        self._server: ThreadingHTTPServer | None = None
        self._on = threading.Event()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/stream.mjpg"

    @property
    def now(self) -> int:
        """Number of the newest frame."""
        return int((time.monotonic() - self._began) * RATE)

    def start(self) -> None:
        camera, on = self, threading.Event()
        on.set()

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
                self.end_headers()
                number = camera.now
                while on.is_set():
                    number = max(number + 1, camera.now)
                    wait = camera._began + number / RATE - time.monotonic()
                    if wait > 0:
                        time.sleep(wait)
                    picture = numbered(camera._pictures[number % len(camera._pictures)], number)
                    data = cv2.imencode(".jpg", picture)[1].tobytes()
                    head = b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(data)
                    try:
                        self.wfile.write(head + data + b"\r\n")
                    except OSError:
                        return

            def log_message(self, *_: object) -> None: ...

        class Server(ThreadingHTTPServer):
            allow_reuse_address = True
            daemon_threads = True
            block_on_close = False

        self._on = on
        self._server = Server(("127.0.0.1", self.port), Handler)
        self.port = self._server.server_port
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()

    def stop(self) -> None:
        self._on.clear()
        if self._server is not None:
            self._server.shutdown()
            self._server.server_close()
            self._server = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
