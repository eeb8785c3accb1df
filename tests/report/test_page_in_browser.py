# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The page in a browser, opened as a file: it makes no request, and all controls work."""

import base64
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_tab import NIGHT, Tab, differing, pixels
from report_pages import Page, changed

from fieldtruth.core.classes import CLASSES
from fieldtruth.report.page import write_report


def test_labels_toggle_with_mouse_and_keyboard(tab: Tab) -> None:
    both = tab.picture(".pair.A .view")
    assert tab.style(".pair.A .tag", "opacity") == "0.55"
    tab.page.locator("label.switch").click()
    assert tab.style(".pair.A .tag", "opacity") == "0"
    photo = tab.picture(".pair.A .view")
    assert differing(both, photo) > 0.5
    tab.page.locator("#tags-on").focus()
    tab.page.keyboard.press("Space")
    assert tab.style(".pair.A .tag", "opacity") == "0.55"
    assert differing(tab.picture(".pair.A .view"), both) == 0.0


def test_slider_blends_photograph_and_tag_image(tab: Tab) -> None:
    tab.page.locator("#tags-opacity").focus()
    tab.page.keyboard.press("End")
    assert tab.words("#tags-value") == "100 %"
    full = tab.picture(".pair.A .view")
    colours = np.array([row.rgb for row in CLASSES if row.rgb])
    exact = (np.abs(full[:, :, None] - colours).max(axis=3) == 0).any(axis=2)
    assert exact.mean() > 0.9  # except the corners and the text in one of them
    tab.page.keyboard.press("Home")
    assert tab.style(".pair.A .tag", "opacity") == "0"
    box = tab.page.locator("#tags-opacity").bounding_box()
    tab.page.mouse.click(box["x"] + box["width"] * 0.25, box["y"] + box["height"] / 2)
    assert 0.2 < float(tab.style(".pair.A .tag", "opacity")) < 0.3
    quarter = tab.picture(".pair.A .view")
    assert 0.0 < differing(quarter, full) <= 1.0


def test_pair_is_selected_by_thumbnail_or_arrow_keys(tab: Tab, page: Page) -> None:
    def shown() -> list[bool]:
        return [pair.is_visible() for pair in tab.page.locator(".pair").all()]

    assert shown() == [True] + 5 * [False]
    tab.page.locator("label[for=pair-D]").click()
    assert shown() == [False, False, False, True, False, False]
    assert tab.page.locator(".pair.D img").evaluate_all("all => all.map(e => e.naturalWidth)") == [320] * 4
    milliseconds = int(tab.page.locator("#pair-D").get_attribute("data-ms"))
    assert tab.words("#time-value") == f"{milliseconds / 1000:.2f} s"
    tab.page.keyboard.press("ArrowRight")
    assert shown() == [False, False, False, False, True, False]


def test_class_under_the_pointer_is_named(tab: Tab, page: Page) -> None:
    tag = pixels(base64.b64decode(page.images("image/png")[0]))
    names = {row.rgb: row.name for row in CLASSES}
    tab.page.locator(".pair.A .view").first.scroll_into_view_if_needed()
    box = tab.page.locator(".pair.A .view").first.bounding_box()
    seen = set()
    for row, column in [(20, 160), (170, 160), (95, 20), (150, 40), (60, 250), (110, 300)]:
        x = box["x"] + (column + 0.5) / 320 * box["width"]
        y = box["y"] + (row + 0.5) / 184 * box["height"]
        tab.page.mouse.move(x, y)
        assert tab.words("#under") == names[tuple(tag[row, column])]
        seen.add(tab.words("#under"))
    assert len(seen) > 2


def test_pointing_at_a_curve_shows_values_of_all_curves_and_moves_the_robot(tab: Tab, page: Page) -> None:
    numbers = page.data("numbers")
    robot = tab.page.locator("#robot").bounding_box()
    plot = tab.page.locator(".curve[data-key=tilt] .plot")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    tab.page.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + 20)
    at = 0.75 * numbers["duration"]
    assert tab.words("#time-value") == f"{at / 1000:.2f} s"
    for curve in ("tilt", "speed", "wheels"):
        shown = tab.page.locator(f".curve[data-key={curve}] .reading").all_inner_texts()
        for words, (times, values) in zip(shown, numbers["curves"][curve], strict=True):
            nearest = int(np.abs(np.array(times) - at).argmin())
            assert float(words.replace("\N{MINUS SIGN}", "-")) == values[nearest]
    cursor = tab.page.locator(".curve[data-key=gnss] .cursor").bounding_box()
    assert cursor["x"] == pytest.approx(box["x"] + 0.75 * box["width"], abs=1.5)
    moved = tab.page.locator("#robot").bounding_box()
    sheet = tab.page.locator(".map .sheet").bounding_box()
    _, left, top = min(numbers["path"], key=lambda row: abs(row[0] - at))
    assert moved["x"] + moved["width"] / 2 == pytest.approx(sheet["x"] + left / 100 * sheet["width"], abs=1.0)
    assert moved["y"] + moved["height"] / 2 == pytest.approx(sheet["y"] + top / 100 * sheet["height"], abs=1.0)
    assert moved["x"] > robot["x"]


def test_time_slider_follows_keys(tab: Tab, page: Page) -> None:
    tab.page.locator("#time").focus()
    tab.page.keyboard.press("End")
    assert tab.words("#time-value") == "1.20 s"
    last = page.data("numbers")["curves"]["speed"][0][1][-1]
    assert tab.words(".curve[data-key=speed] .reading") == str(last)


def test_curve_and_tick_labels_are_aligned(tab: Tab) -> None:
    """Tick labels are HTML and the curve is SVG: both must be stretched alike."""
    box = tab.page.locator(".curve[data-key=speed] .plot").bounding_box()
    ticks = tab.page.locator(".curve[data-key=speed] .y")
    positions = {float(tick.inner_text()): tick.bounding_box() for tick in ticks.all()}
    lines = tab.page.locator(".curve[data-key=speed] svg line[x1='0'][x2='1000']").all()
    heights = sorted(line.bounding_box()["y"] for line in lines)
    assert heights == pytest.approx(sorted(b["y"] + b["height"] / 2 for b in positions.values()), abs=1.2)
    assert max(b["x"] + b["width"] for b in positions.values()) <= box["x"]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1280])
def test_page_fits_the_window_and_has_contrast(browser: Any, page: Page, scheme: str, width: int) -> None:
    tab = Tab(browser, page.path, viewport={"width": width, "height": 800}, color_scheme=scheme)
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


def test_copy_button_copies_the_code(tab: Tab) -> None:
    tab.context.grant_permissions(["clipboard-read", "clipboard-write"])
    button = tab.page.locator(".exports .copy").nth(2)
    button.click()
    tab.until(lambda: button.inner_text() == "Copied")
    assert tab.page.evaluate("navigator.clipboard.readText()") == "fieldtruth export park_1.bag --to semantickitti"


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
    tab = Tab(browser, write_report(bag, out=tmp_path / "page.html"))
    assert tab.page.evaluate("window.hacked") is None
    assert tab.page.locator("img[onerror]").count() == 0
    assert tab.words("h1") == "<img src=x onerror=hacked=3>"
    assert differing(tab.canvas(), np.full_like(tab.canvas(), NIGHT)) > 0.03
    tab.close()
