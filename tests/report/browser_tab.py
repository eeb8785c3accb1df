# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A page in a real browser: a tab that records requests and errors, and reads pixels."""

import base64
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
]  # fmt: skip
NO_WEBGL = """
const get = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...others) {
  return kind === "webgl2" ? null : get.call(this, kind, ...others);
};"""
NIGHT = (30, 35, 43)
"""Background of the cloud."""

Pixels = NDArray[np.int16]


@contextmanager
def opened_browser() -> Iterator[Any]:
    """Open a headless browser; skip the test if none is installed."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install 'fieldtruth[test]'")
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"needs a browser, one of {', '.join(BROWSERS)}: apt-get install chromium")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, headless=True, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


class Tab:
    """An open page with its requests and errors; without ``cloud``, which takes long to draw, its poster is shown."""

    def __init__(self, browser: Any, path: Path, *, cloud: bool = True, **options: Any) -> None:
        usual = {
            "viewport": {"width": 1000, "height": 700},
            "reduced_motion": "reduce",
        }  # smooth scrolling moves what is read
        self.context = browser.new_context(**(usual | options))
        self.context.set_offline(True)
        if not cloud:
            self.context.add_init_script(NO_WEBGL)
        self.page = self.context.new_page()
        self.requests: list[str] = []
        self.errors: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("dialog", lambda dialog: self.errors.append(f"dialog {dialog.message}"))
        self.page.on("console", self._console)
        self.page.goto(path.as_uri())
        self.page.wait_for_load_state("load")
        self.path = path

    def _console(self, note: Any) -> None:
        if note.type == "error":
            self.errors.append(note.text)

    def close(self) -> None:
        """Close the page and check that it made no request and had no error."""
        self.settle()
        self.context.close()
        assert self.requests == [self.path.as_uri()]
        assert self.errors == []

    def settle(self) -> None:
        """Wait for two animation frames."""
        self.page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def until(self, condition: Callable[[], bool]) -> None:
        """Wait at most ten seconds for a condition. (The page's security policy blocks Playwright's own waiting.)"""
        for _ in range(200):
            if condition():
                return
            self.page.wait_for_timeout(50)
        raise AssertionError("condition not met within 10 s")

    def canvas(self) -> Pixels:
        """Pixels (h, w, 3) of the canvas of the cloud."""
        self.settle()
        return pixels(base64.b64decode(self.page.evaluate("document.getElementById('canvas').toDataURL()")[22:]))

    def picture(self, selector: str) -> Pixels:
        """Pixels (h, w, 3) of a screenshot of an element."""
        self.settle()
        return pixels(self.page.locator(selector).first.screenshot())

    def style(self, selector: str, name: str) -> str:
        """Computed style of the first such element."""
        return str(self.page.locator(selector).first.evaluate(f"e => getComputedStyle(e).getPropertyValue('{name}')"))

    def words(self, selector: str) -> str:
        """Text of the first such element."""
        return str(self.page.locator(selector).first.inner_text()).strip()

    def middle(self, selector: str) -> tuple[float, float]:
        """Middle of an element [pixel], after scrolling it into view."""
        found = self.page.locator(selector).first
        found.scroll_into_view_if_needed()
        box = found.bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def drag(self, dx: float, dy: float, *, button: str = "left") -> None:
        """Drag on the cloud by dx, dy [pixel]."""
        x, y = self.middle("#canvas")
        self.page.mouse.move(x, y)
        self.page.mouse.down(button=button)
        self.page.mouse.move(x + dx / 2, y + dy / 2)
        self.page.mouse.move(x + dx, y + dy)
        self.page.mouse.up(button=button)


def pixels(png: bytes) -> Pixels:
    """Pixels (h, w, 3) of a PNG."""
    return np.asarray(Image.open(BytesIO(png)).convert("RGB")).astype(np.int16)


def differing(a: Pixels, b: Pixels | tuple[int, int, int]) -> float:
    """Share of the pixels that differ by more than 24 in a channel from others, or from one colour."""
    a, b = np.broadcast_arrays(a, np.asarray(b, np.int16))
    return float(np.logical_or.reduce([np.abs(a[..., k] - b[..., k]) > 24 for k in range(3)]).mean())


def of_ground(picture: Pixels) -> int:
    """Number of pixels in the green of ground, at any brightness."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    return int(((red < 12) & (blue < 12) & (green > 40)).sum())
