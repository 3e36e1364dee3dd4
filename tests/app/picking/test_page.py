"""The page in a real browser: what is drawn with the pointer is what is run."""

import json
import os
import re
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.app.command_line import ENVIRONMENT, PROGRAM, turning
from tests.app.mjpeg import Camera

START_S = 30.0
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")


class Browser:
    """A headless Chromium, driven by chromedriver (W3C WebDriver, plain HTTP)."""

    def __init__(self, driver_url: str, program: str) -> None:
        self._driver_url = driver_url
        options = {"binary": program, "args": ["--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1100,900"]}
        wanted = {"capabilities": {"alwaysMatch": {"goog:chromeOptions": options}}}
        self._session = f"/session/{self._call('POST', '/session', wanted)['sessionId']}"

    def _call(self, method: str, path: str, body: object = None) -> Any:
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            f"{self._driver_url}{path}", data, {"Content-Type": "application/json"}, method=method
        )
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)["value"]

    def open(self, url: str) -> None:
        self._call("POST", f"{self._session}/url", {"url": url})

    def run(self, script: str) -> Any:
        return self._call("POST", f"{self._session}/execute/sync", {"script": script, "args": []})

    def wait(self, condition: str) -> None:
        end = time.monotonic() + START_S
        while not self.run(f"return Boolean({condition})"):
            assert time.monotonic() < end, condition
            time.sleep(0.05)

    def pointer(self, *steps: tuple[str, int, int]) -> None:
        """Move to pixels of the picture, press and release there."""
        left, top, scale = self.run(
            "const b = document.getElementById('canvas').getBoundingClientRect();"
            "return [b.left, b.top, b.width / document.getElementById('canvas').width]"
        )
        actions: list[dict[str, object]] = []
        for what, x, y in steps:
            place = {"x": round(left + (x + 0.5) * scale), "y": round(top + (y + 0.5) * scale), "origin": "viewport"}
            actions.append({"type": "pointerMove", "duration": 20, **place})
            presses = {"down": ["pointerDown"], "up": ["pointerUp"], "click": ["pointerDown", "pointerUp"]}[what]
            actions += [{"type": press, "button": 0} for press in presses]
        mouse = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": actions}
        self._call("POST", f"{self._session}/actions", {"actions": [mouse]})

    def close(self) -> None:
        self._call("DELETE", self._session)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    program = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, BROWSERS)), None)
    driver = os.environ.get("CHROMEDRIVER") or shutil.which("chromedriver")
    if not program or not driver:
        pytest.skip("no Chromium with its chromedriver: apt-get install chromium-driver, or set CHROMIUM and CHROMEDRIVER")
    process = subprocess.Popen([driver, "--port=0"], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        port = next(
            found[1] for line in process.stdout if (found := re.search(r"started successfully on port (\d+)", line))
        )
        opened = Browser(f"http://127.0.0.1:{port}", program)
        yield opened
        opened.close()
    finally:
        process.kill()
        process.wait()


def picking(folder: Path, *arguments: object) -> tuple["subprocess.Popen[str]", str]:
    """`modeshape pick`, and the address it tells."""
    command = [*PROGRAM, "pick", *map(str, arguments), "--no-open"]
    process = subprocess.Popen(
        command, cwd=folder, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    told = next(line for line in process.stderr if "http://" in line)
    return process, told.split()[-1]


def test_a_rectangle_is_run(browser: Browser, videos: Path, tmp_path: Path) -> None:
    more = "--options=--frames :12 --image none --points 60 --json --no-final-pass --out run.rrd --tracks-out tracks.npz"
    process, url = picking(tmp_path, videos / "turning.mp4", "--run", "--json", more)
    browser.open(url)
    browser.wait("picture.width")
    assert browser.run("return [canvas.width, canvas.height]") == [320, 240]
    browser.pointer(("down", 60, 50), ("up", 260, 190))
    browser.run("document.getElementById('done').click()")
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert "--roi 60 50 200 140" in err
    words = json.loads(out)
    assert words["frames"] == 12
    assert (tmp_path / "run.rrd").exists()
    import numpy as np

    with np.load(tmp_path / "tracks.npz") as tracks:
        x, y = tracks["W"][0]
    assert x.min() >= 60
    assert x.max() <= 260
    assert y.min() >= 50
    assert y.max() <= 190


def test_a_polygon_is_run(browser: Browser, videos: Path, tmp_path: Path) -> None:
    more = "--options=--image none --points 60 --json --no-final-pass --out run.rrd --tracks-out tracks.npz --duration 0.4"
    process, url = picking(tmp_path, videos / "turning.mp4", "--run", "--json", more)
    browser.open(url)
    browser.wait("picture.width")
    browser.run("document.getElementById('polygon').click()")
    for x, y in ((60, 40), (270, 60), (250, 200), (90, 190)):
        browser.pointer(("click", x, y))
    browser.pointer(("click", 10, 10))
    browser.run("document.getElementById('undo').click()")
    browser.run("document.getElementById('done').click()")
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert "--polygon 60 40 270 60 250 200 90 190" in err
    assert json.loads(out)["frames"] >= 10
    import cv2
    import numpy as np

    with np.load(tmp_path / "tracks.npz") as tracks:
        points = tracks["W"][0].T.astype(np.float32)
    corners = np.array([(60, 40), (270, 60), (250, 200), (90, 190)], np.float32)
    assert min(cv2.pointPolygonTest(corners, (float(x), float(y)), True) for x, y in points) >= -1.0


def test_a_camera_s_picture_is_taken_after_a_countdown(browser: Browser, tmp_path: Path) -> None:
    with Camera(list(turning(30))) as camera:
        process, url = picking(tmp_path, camera.url)
        browser.open(url)
        browser.wait("picture.width && live")
        first = browser.run("return canvas.toDataURL()")
        browser.wait(f"canvas.toDataURL() !== '{first}'")  # it moves
        assert browser.run("return document.getElementById('done').disabled")
        browser.run("document.getElementById('freeze').click()")
        browser.wait("document.getElementById('count').textContent === '1'")
        browser.wait("!live")
        browser.pointer(("down", 60, 50), ("up", 260, 190))
        browser.run("document.getElementById('done').click()")
        out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert out.strip().endswith("/stream.mjpg --roi 60 50 200 140")


def test_four_corners_of_a_later_frame_are_told(browser: Browser, videos: Path, tmp_path: Path) -> None:
    process, url = picking(tmp_path, videos / "turning.mp4", "--frame", 5)
    browser.open(url)
    browser.wait("picture.width")
    browser.run("document.getElementById('corners').click()")
    for x, y in ((60, 40), (270, 60), (250, 200), (90, 190)):
        browser.pointer(("click", x, y))
    browser.run("document.getElementById('done').click()")
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert out.strip().endswith("turning.mp4 --frames 5: --corners 60 40 270 60 250 200 90 190")
