# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The cloud of the page in a browser: orbit, pan, zoom, filter and colours, by mouse, keys and touch."""

import base64
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from browser_tab import NIGHT, Tab, differing, of_ground
from report_pages import Page

from fieldtruth.core.classes import Label


@pytest.fixture
def tab(browser: Any, page: Page) -> Iterator[Tab]:
    """The page in a small window, because without a GPU each pixel of the cloud takes its time."""
    opened = Tab(browser, page.path, viewport={"width": 560, "height": 480})
    yield opened
    opened.close()


def test_cloud_is_visible_and_orbits_pans_and_resets(tab: Tab) -> None:
    first = tab.canvas()
    assert differing(first, NIGHT) > 0.2
    tab.drag(160, 0)
    turned = tab.canvas()
    assert differing(first, turned) > 0.1
    tab.drag(0, 120)
    assert differing(turned, tab.canvas()) > 0.1
    tab.page.locator("#home").click()
    assert (tab.canvas() == first).all()
    tab.drag(120, 60, button="right")
    assert differing(tab.canvas(), first) > 0.1
    tab.page.locator("#canvas").dblclick()
    assert (tab.canvas() == first).all()


@pytest.mark.slow
def test_wheel_zooms_only_after_a_click(tab: Tab) -> None:
    first = tab.canvas()
    x, y = tab.middle("#canvas")
    tab.page.mouse.move(x, y)
    before = tab.page.evaluate("scrollY")
    tab.page.mouse.wheel(0, 120)
    tab.until(lambda: tab.page.evaluate("scrollY") > before)
    assert (tab.canvas() == first).all()
    tab.page.mouse.click(*tab.middle("#canvas"))
    before = tab.page.evaluate("scrollY")
    tab.page.mouse.wheel(0, -240)
    tab.page.wait_for_timeout(100)
    assert tab.page.evaluate("scrollY") == before
    assert differing(tab.canvas(), first) > 0.1


@pytest.mark.slow
def test_keys_orbit_zoom_and_reset_the_cloud(tab: Tab) -> None:
    first = tab.canvas()
    tab.page.locator("#canvas").focus()
    for key in ("ArrowLeft", "ArrowUp", "+"):
        before = tab.canvas()
        tab.page.keyboard.press(key)
        assert differing(before, tab.canvas()) > 0.02, key
    tab.page.keyboard.press("Home")
    assert (tab.canvas() == first).all()


@pytest.mark.slow
def test_classes_can_be_hidden(tab: Tab) -> None:
    first = tab.canvas()
    assert of_ground(first) > 0.05 * first.shape[0] * first.shape[1]
    ground = tab.page.locator(f"#legend input[value='{int(Label.GROUND)}']")
    ground.click()
    without = tab.canvas()
    assert of_ground(without) == 0
    assert differing(without, NIGHT) > 0.02  # the others are still visible
    ground.focus()
    tab.page.keyboard.press("Space")
    assert (tab.canvas() == first).all()
    tab.page.locator("#none").click()
    nothing = tab.canvas()
    assert (nothing == NIGHT).all()
    tab.page.locator("#all").click()
    assert (tab.canvas() == first).all()


@pytest.mark.slow
def test_cloud_can_be_coloured_by_height(tab: Tab) -> None:
    first = tab.canvas()
    tab.page.locator("input[name=colour][value=height]").check(force=True)
    by_height = tab.canvas()
    assert of_ground(by_height) == 0
    # Low points are violet; the ground, in the middle of the image, is low.
    red, green, blue = by_height[by_height.shape[0] // 2 :].reshape(-1, 3)[::7].T
    lit = (np.abs(np.array([red, green, blue]).T - NIGHT).max(axis=1) > 20) & (np.maximum(red, blue) > 25)
    assert (blue[lit] > green[lit]).mean() > 0.5
    assert tab.page.locator("#ramp").is_visible()
    tab.page.locator("input[name=colour][value=class]").check(force=True)
    assert (tab.canvas() == first).all()


def test_path_in_the_cloud_matches_pinhole_projection(tab: Tab, page: Page) -> None:
    """With only the path visible, from a changed viewpoint, its pixels match the projection."""
    settings = page.data("cloud-settings")
    tab.page.locator("#none").click()
    tab.page.locator(f"#legend input[value='{settings['path']}']").click()
    tab.page.locator("#canvas").focus()
    for _ in range(8):
        tab.page.keyboard.press("+")
    tab.page.keyboard.press("ArrowRight")  # like a drag of 24 pixels, 0.35 deg each
    picture = tab.canvas()
    height, width = picture.shape[:2]
    drawn = np.abs(picture[::2, ::2] - NIGHT).max(axis=2) > 40
    found = re.search(r'id="cloud-data">([^<]*)<', page.text)
    assert found is not None
    data, n = base64.b64decode(found[1]), settings["count"]
    route = np.frombuffer(data, np.uint8, offset=6 * n) == settings["path"]
    xyz = np.frombuffer(data, "<i2", 3 * n).reshape(n, 3)[route] * settings["step"] + settings["middle"]
    azimuth, elevation = np.radians(settings["azimuth"] - 0.35 * 24), np.radians(settings["elevation"])
    forward = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation)])
    right = np.cross(forward, (0, 0, 1)) / np.linalg.norm(np.cross(forward, (0, 0, 1)))
    seen = xyz - (np.array(settings["target"]) - settings["distance"] * 0.85**8 * forward)
    depth, focal = seen @ forward, height / 2 / np.tan(np.radians(settings["fov"]) / 2)
    column = width / 2 + focal * (seen @ right) / depth
    row = height / 2 + focal * (seen @ np.cross(forward, right)) / depth
    radius = 1.35 * 2.5 * settings["voxel"] * focal / depth.mean() / 2
    x, y = np.meshgrid(np.arange(0, width, 2) + 0.5, np.arange(0, height, 2) + 0.5)
    expected = (np.hypot(x[..., None] - column, y[..., None] - row) < radius).any(axis=2)
    assert (drawn & expected).sum() > 0.85 * (drawn | expected).sum()
    for flipped in (expected[:, ::-1], expected[::-1]):  # the test would detect a mirrored image
        assert (drawn & flipped).sum() < 0.6 * (drawn | flipped).sum()


@pytest.mark.slow
def test_touch_orbits_and_zooms_the_cloud(browser: Any, page: Page) -> None:
    tab = Tab(browser, page.path, viewport={"width": 400, "height": 800}, has_touch=True, is_mobile=True)
    x, y = tab.middle("#canvas")
    touch = tab.context.new_cdp_session(tab.page)

    def send(kind: str, *touches: tuple[float, float]) -> None:
        points = [{"x": px, "y": py, "id": k} for k, (px, py) in enumerate(touches)]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    first = tab.canvas()
    send("touchStart", (x, y))
    for k in range(1, 7):
        send("touchMove", (x + 12 * k, y))
    send("touchEnd")
    turned = tab.canvas()
    assert differing(first, turned) > 0.1
    send("touchStart", (x - 20, y), (x + 20, y))
    for k in range(1, 7):
        send("touchMove", (x - 20 - 8 * k, y), (x + 20 + 8 * k, y))
    send("touchEnd")
    assert differing(turned, tab.canvas()) > 0.1
    assert tab.page.evaluate("visualViewport.scale") == 1  # the page itself is not zoomed
    tab.close()


def test_poster_is_shown_without_webgl(browser: Any, page: Page) -> None:
    tab = Tab(browser, page.path, cloud=False, viewport={"width": 1000, "height": 900})
    assert tab.page.locator("#canvas").is_hidden()
    still = tab.picture("#screen")
    assert of_ground(still) > 0.01 * still.shape[0] * still.shape[1]  # 1.4 %: single points; an empty cloud has none
    tab.close()
