# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The page's cloud in a real browser: it is seen, turned, zoomed, filtered and coloured, by mouse, keys and fingers."""

import base64
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_tab import NIGHT, Tab, differing, of_ground, opened_browser, pixels
from report_pages import Page, page_of

from fieldtruth.core.classes import Label


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with opened_browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def text(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Page:
    return page_of(small_run, tmp_path_factory)


@pytest.fixture
def tab(browser: Any, text: Page) -> Iterator[Tab]:
    opened = Tab(browser, text.path)
    yield opened
    opened.close()


def test_the_cloud_is_seen_and_turns(tab: Tab) -> None:
    first = tab.canvas()
    assert differing(first, np.full_like(first, NIGHT)) > 0.2
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


def test_the_wheel_zooms_only_a_cloud_that_was_clicked(tab: Tab) -> None:
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


def test_the_cloud_obeys_keys(tab: Tab) -> None:
    first = tab.canvas()
    tab.page.locator("#canvas").focus()
    for key in ("ArrowLeft", "ArrowUp", "+"):
        before = tab.canvas()
        tab.page.keyboard.press(key)
        assert differing(before, tab.canvas()) > 0.02, key
    tab.page.keyboard.press("Home")
    assert (tab.canvas() == first).all()


def test_a_class_can_be_switched_off(tab: Tab) -> None:
    first = tab.canvas()
    assert of_ground(first) > 0.05 * first.shape[0] * first.shape[1]
    ground = tab.page.locator(f"#legend input[value='{int(Label.GROUND)}']")
    ground.click()
    without = tab.canvas()
    assert of_ground(without) == 0
    assert differing(without, np.full_like(without, NIGHT)) > 0.02  # the others are still there
    ground.focus()
    tab.page.keyboard.press("Space")
    assert (tab.canvas() == first).all()
    tab.page.locator("#none").click()
    nothing = tab.canvas()
    assert (nothing == NIGHT).all()
    tab.page.locator("#all").click()
    assert (tab.canvas() == first).all()


def test_the_cloud_can_be_coloured_by_height(tab: Tab) -> None:
    first = tab.canvas()
    tab.page.locator("input[name=colour][value=height]").check(force=True)
    by_height = tab.canvas()
    assert of_ground(by_height) == 0
    # What is low is violet; the ground, in the middle of the picture, is low.
    red, green, blue = by_height[by_height.shape[0] // 2 :].reshape(-1, 3)[::7].T
    lit = (np.abs(np.array([red, green, blue]).T - NIGHT).max(axis=1) > 20) & (np.maximum(red, blue) > 25)
    assert (blue[lit] > green[lit]).mean() > 0.5
    assert tab.page.locator("#ramp").is_visible()
    tab.page.locator("input[name=colour][value=class]").check(force=True)
    assert (tab.canvas() == first).all()


def test_the_way_is_drawn_where_a_pinhole_sees_it(tab: Tab, text: Page) -> None:
    """Nothing but the way is shown, from a place that was dragged to: its ends must be where geometry has them."""
    settings = text.data("cloud-settings")
    tab.page.locator("#none").click()
    tab.page.locator(f"#legend input[value='{settings['route']}']").click()
    tab.page.locator("#canvas").focus()
    for _ in range(8):
        tab.page.keyboard.press("+")
    tab.page.keyboard.press("ArrowRight")  # 24 pixels of a drag, 0.35 deg each
    picture = tab.canvas()
    height, width = picture.shape[:2]
    drawn = np.abs(picture - NIGHT).max(axis=2) > 40
    found = re.search(r'id="cloud-data">([^<]*)<', text.text)
    assert found is not None
    data, n = base64.b64decode(found[1]), settings["count"]
    route = np.frombuffer(data, np.uint8, offset=6 * n) == settings["route"]
    xyz = np.frombuffer(data, "<i2", 3 * n).reshape(n, 3)[route] * settings["step"] + settings["middle"]
    azimuth, elevation = np.radians(settings["azimuth"] - 0.35 * 24), np.radians(settings["elevation"])
    forward = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation)])
    right = np.cross(forward, (0, 0, 1)) / np.linalg.norm(np.cross(forward, (0, 0, 1)))
    seen = xyz - (np.array(settings["target"]) - settings["distance"] * 0.85**8 * forward)
    depth, focal = seen @ forward, height / 2 / np.tan(np.radians(settings["fov"]) / 2)
    column = width / 2 + focal * (seen @ right) / depth
    row = height / 2 + focal * (seen @ np.cross(forward, right)) / depth
    radius = 1.35 * 2.5 * settings["voxel"] * focal / depth.mean() / 2
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    expected = (np.hypot(x[..., None] - column, y[..., None] - row) < radius).any(axis=2)
    assert (drawn & expected).sum() > 0.85 * (drawn | expected).sum()
    for flipped in (expected[:, ::-1], expected[::-1]):  # so that it would be seen if a picture were a mirror's
        assert (drawn & flipped).sum() < 0.6 * (drawn | flipped).sum()


def test_fingers_turn_and_zoom_the_cloud(browser: Any, text: Page) -> None:
    tab = Tab(browser, text.path, viewport={"width": 400, "height": 800}, has_touch=True, is_mobile=True)
    x, y = tab.middle("#canvas")
    touch = tab.context.new_cdp_session(tab.page)

    def send(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": px, "y": py, "id": k} for k, (px, py) in enumerate(places)]
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
    assert tab.page.evaluate("visualViewport.scale") == 1  # the cloud was zoomed, not the page
    tab.close()


def test_without_webgl_a_still_picture_stays(browser: Any, text: Page) -> None:
    opened = browser.new_context(viewport={"width": 1000, "height": 900})
    opened.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page = opened.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(text.path.as_uri())
    assert page.locator("#canvas").is_hidden()
    still = pixels(page.locator("#screen").screenshot())
    assert of_ground(still) > 0.015 * still.shape[0] * still.shape[1]
    assert errors == []
    opened.close()
