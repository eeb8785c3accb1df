# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The page in a browser, opened as a file: it makes no request, and all controls work."""

import base64
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_tab import NIGHT, Tab, differing, pixels
from report_pages import Page, changed

from fieldtruth.core.classes import CLASSES
from fieldtruth.report.page import write_report


@pytest.fixture
def plain(browser: Any, page: Page) -> Iterator[Tab]:
    """The page of the small run without its cloud."""
    opened = Tab(browser, page.path, cloud=False)
    yield opened
    opened.close()


@pytest.fixture
def tab(browser: Any, page: Page) -> Iterator[Tab]:
    """The page with its cloud in a small window, because each pixel of the cloud takes its time."""
    opened = Tab(browser, page.path, viewport={"width": 560, "height": 480})
    yield opened
    opened.close()


def test_labels_toggle_with_mouse_and_keyboard(plain: Tab) -> None:
    both = plain.picture(".pair.A .view")
    assert plain.style(".pair.A .tag", "opacity") == "0.55"
    plain.page.locator("label.switch").click()
    assert plain.style(".pair.A .tag", "opacity") == "0"
    photo = plain.picture(".pair.A .view")
    assert differing(both, photo) > 0.5
    plain.page.locator("#tags-on").focus()
    plain.page.keyboard.press("Space")
    assert plain.style(".pair.A .tag", "opacity") == "0.55"
    assert differing(plain.picture(".pair.A .view"), both) == 0.0


@pytest.mark.slow
def test_slider_blends_photograph_and_tag_image(plain: Tab) -> None:
    plain.page.locator("#tags-opacity").focus()
    plain.page.keyboard.press("End")
    assert plain.words("#tags-value") == "100 %"
    full = plain.picture(".pair.A .view")
    colours = np.array([row.rgb for row in CLASSES if row.rgb])
    exact = (np.abs(full[:, :, None] - colours).max(axis=3) == 0).any(axis=2)
    assert exact.mean() > 0.9  # except the corners and the text in one of them
    plain.page.keyboard.press("Home")
    assert plain.style(".pair.A .tag", "opacity") == "0"
    box = plain.page.locator("#tags-opacity").bounding_box()
    plain.page.mouse.click(box["x"] + box["width"] * 0.25, box["y"] + box["height"] / 2)
    assert 0.2 < float(plain.style(".pair.A .tag", "opacity")) < 0.3
    quarter = plain.picture(".pair.A .view")
    assert 0.0 < differing(quarter, full) <= 1.0


@pytest.mark.slow
def test_pair_is_selected_by_thumbnail_or_arrow_keys(plain: Tab, page: Page) -> None:
    def shown() -> list[bool]:
        return [pair.is_visible() for pair in plain.page.locator(".pair").all()]

    assert shown() == [True] + 5 * [False]
    plain.page.locator("label[for=pair-D]").click()
    assert shown() == [False, False, False, True, False, False]
    assert plain.page.locator(".pair.D img").evaluate_all("all => all.map(e => e.naturalWidth)") == [160] * 4
    milliseconds = int(plain.page.locator("#pair-D").get_attribute("data-ms"))
    assert plain.words("#time-value") == f"{milliseconds / 1000:.2f} s"
    plain.page.keyboard.press("ArrowRight")
    assert shown() == [False, False, False, False, True, False]


@pytest.mark.slow
def test_class_under_the_pointer_is_named(plain: Tab, page: Page) -> None:
    tag = pixels(base64.b64decode(page.images("image/png")[0]))
    names = {row.rgb: row.name for row in CLASSES}
    plain.page.locator(".pair.A .view").first.scroll_into_view_if_needed()
    box = plain.page.locator(".pair.A .view").first.bounding_box()
    seen = set()
    for row, column in [(10, 80), (85, 80), (47, 10), (75, 20), (30, 125), (55, 150)]:
        x = box["x"] + (column + 0.5) / 160 * box["width"]
        y = box["y"] + (row + 0.5) / 92 * box["height"]
        plain.page.mouse.move(x, y)
        assert plain.words("#under") == names[tuple(tag[row, column])]
        seen.add(plain.words("#under"))
    assert len(seen) > 2


@pytest.mark.slow
def test_pointing_at_a_curve_shows_values_of_all_curves_and_moves_the_robot(plain: Tab, page: Page) -> None:
    numbers = page.data("numbers")
    robot = plain.page.locator("#robot").bounding_box()
    plot = plain.page.locator(".curve[data-key=tilt] .plot")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    plain.page.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + 20)
    at = 0.75 * numbers["duration"]
    assert plain.words("#time-value") == f"{at / 1000:.2f} s"
    for curve in ("tilt", "speed", "wheels"):
        shown = plain.page.locator(f".curve[data-key={curve}] .reading").all_inner_texts()
        for words, (times, values) in zip(shown, numbers["curves"][curve], strict=True):
            nearest = int(np.abs(np.array(times) - at).argmin())
            assert float(words.replace("\N{MINUS SIGN}", "-")) == values[nearest]
    cursor = plain.page.locator(".curve[data-key=position] .cursor").bounding_box()
    assert cursor["x"] == pytest.approx(box["x"] + 0.75 * box["width"], abs=1.5)
    moved = plain.page.locator("#robot").bounding_box()
    sheet = plain.page.locator(".map .sheet").bounding_box()
    _, left, top = min(numbers["path"], key=lambda row: abs(row[0] - at))
    assert moved["x"] + moved["width"] / 2 == pytest.approx(sheet["x"] + left / 100 * sheet["width"], abs=1.0)
    assert moved["y"] + moved["height"] / 2 == pytest.approx(sheet["y"] + top / 100 * sheet["height"], abs=1.0)
    assert moved["x"] > robot["x"]


def test_time_slider_follows_keys(plain: Tab, page: Page) -> None:
    plain.page.locator("#time").focus()
    plain.page.keyboard.press("End")
    assert plain.words("#time-value") == "1.20 s"
    last = page.data("numbers")["curves"]["speed"][0][1][-1]
    assert plain.words(".curve[data-key=speed] .reading") == str(last)


@pytest.mark.slow
def test_curve_and_tick_labels_are_aligned(plain: Tab) -> None:
    """Tick labels are HTML and the curve is SVG: both must be stretched alike."""
    box = plain.page.locator(".curve[data-key=speed] .plot").bounding_box()
    ticks = plain.page.locator(".curve[data-key=speed] .y")
    positions = {float(tick.inner_text()): tick.bounding_box() for tick in ticks.all()}
    lines = plain.page.locator(".curve[data-key=speed] svg line[x1='0'][x2='1000']").all()
    heights = sorted(line.bounding_box()["y"] for line in lines)
    assert heights == pytest.approx(sorted(b["y"] + b["height"] / 2 for b in positions.values()), abs=1.2)
    assert max(b["x"] + b["width"] for b in positions.values()) <= box["x"]


@pytest.mark.parametrize(("scheme", "width"), [("light", 400), ("dark", 1280)])
def test_page_fits_the_window_and_has_contrast(browser: Any, page: Page, scheme: str, width: int) -> None:
    options = {"viewport": {"width": width, "height": 800}, "color_scheme": scheme}
    tab = Tab(browser, page.path, cloud=scheme == "light", **options)
    assert tab.page.evaluate("[document.documentElement.scrollWidth, innerWidth]") == [width, width]
    ground = rgb(tab.style("body", "background-color"))
    assert (sum(ground) < 100) == (scheme == "dark")
    for selector in ("body", ".intro", ".key dt", ".top a", ".eyebrow", ".shares thead .points", ".plot .y", ".count"):
        assert contrast(rgb(tab.style(selector, "color")), ground) >= 4.5, selector
    for selector in ("pre", "button"):
        assert contrast(rgb(tab.style(selector, "color")), rgb(tab.style(selector, "background-color"))) >= 4.5
    for channel in range(4):
        colour = rgb(tab.style(f".curve[data-key=wheels] path.c{channel}", "stroke"))
        assert contrast(colour, ground) >= 3.0
    tab.close()


def rgb(colour: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", colour)[:3]))


def contrast(a: tuple[int, ...], b: tuple[int, ...]) -> float:
    """Ratio by WCAG 2."""
    light, dark = sorted((luminance(a), luminance(b)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def luminance(colour: tuple[int, ...]) -> float:
    share = np.array(colour) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def test_tab_key_reaches_every_control(tab: Tab) -> None:
    reached = set()
    for _ in range(120):
        tab.page.keyboard.press("Tab")
        where = tab.page.evaluate("(e => e.id || e.name || e.className || e.tagName)(document.activeElement)")
        if where == "BODY":
            break
        reached.add(where)
    assert {"skip", "tags-on", "tags-opacity", "pair-A", "canvas", "colour", "all", "home", "time", "copy"} <= reached


def test_copy_button_copies_the_code(plain: Tab) -> None:
    plain.context.grant_permissions(["clipboard-read", "clipboard-write"])
    button = plain.page.locator(".exports .copy").nth(2)
    button.click()
    plain.until(lambda: button.inner_text() == "Copied")
    assert plain.page.evaluate("navigator.clipboard.readText()") == "fieldtruth export park_1.bag --to semantickitti"


def test_page_works_without_scripts(browser: Any, page: Page) -> None:
    tab = Tab(browser, page.path, java_script_enabled=False)
    both = pixels(tab.page.locator(".pair.A .view").first.screenshot())
    tab.page.locator("label.switch").click()
    assert differing(both, pixels(tab.page.locator(".pair.A .view").first.screenshot())) > 0.5
    tab.page.locator("label[for=pair-B]").click()
    assert tab.page.locator(".pair.B").is_visible()
    assert not tab.page.locator(".pair.A").is_visible()
    assert tab.page.locator(".poster").is_visible()
    assert tab.page.locator(".copy").first.is_hidden()
    tab.context.close()
    assert tab.requests == [page.path.as_uri()]


@pytest.mark.slow
def test_print_shows_all_pairs_and_no_controls(tab: Tab) -> None:
    tab.page.emulate_media(media="print")
    assert all(pair.is_visible() for pair in tab.page.locator(".pair").all())
    assert tab.page.locator(".poster").is_visible()
    for selector in ("nav", "#canvas", "#tag-controls", ".copy", ".strip", "#home"):
        assert tab.page.locator(selector).first.is_hidden(), selector


def test_hostile_names_are_inert_in_the_browser(browser: Any, small_run: Path, tmp_path: Path) -> None:
    evil = '</script><script>window.hacked=1</script><img src="http://127.0.0.1/x" onerror="window.hacked=2">'
    names = {"/os1_cloud_node/points": "/os1_cloud_node/points", "/imu/data": f"/{evil}", "/navsat/fix": "/navsat/fix"}

    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        return (names[topic], stamp, data) if topic in names else None

    bag = changed(small_run / "park_1.bag", tmp_path / "<img src=x onerror=hacked=3>.bag", change)
    page = write_report(bag, out=tmp_path / "page.html")
    tab = Tab(browser, page, viewport={"width": 560, "height": 480})
    assert tab.page.evaluate("window.hacked") is None
    assert tab.page.locator("img[onerror]").count() == 0
    assert tab.words("h1") == "<img src=x onerror=hacked=3>"
    assert differing(tab.canvas(), NIGHT) > 0.03
    tab.close()
