# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser, opened as a file: it asks for nothing, and everything on it can be used."""

import base64
import re
import shutil
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from report_pages import Page, changed, page_of

from fieldtruth.classes import CLASSES, Label
from fieldtruth.report.page import write_report

sync_api = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install 'fieldtruth[test]'")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
]  # fmt: skip
NIGHT = (30, 35, 43)

Pixels = NDArray[np.int64]


class Tab:
    """An open page, and all that it asked for or complained about."""

    def __init__(self, browser: Any, path: Path, **options: Any) -> None:
        self.context = browser.new_context(**({"viewport": {"width": 1000, "height": 700}} | options))
        self.context.set_offline(True)
        self.page = self.context.new_page()
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("dialog", lambda dialog: self.complaints.append(f"dialog {dialog.message}"))
        self.page.on("console", self._console)
        self.page.goto(path.as_uri())
        self.page.wait_for_load_state("load")
        self.path = path

    def _console(self, note: Any) -> None:
        if note.type == "error":
            self.complaints.append(note.text)

    def close(self) -> None:
        """Close it; whatever it was used for, it must have kept still."""
        self.settle()
        self.context.close()
        assert self.requests == [self.path.as_uri()]
        assert self.complaints == []

    def settle(self) -> None:
        """Wait until what was asked for is drawn."""
        self.page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def until(self, condition: Callable[[], bool]) -> None:
        """Wait for something, at most ten seconds. (The page forbids the scripts by which Playwright itself waits.)"""
        for _ in range(200):
            if condition():
                return
            self.page.wait_for_timeout(50)
        raise AssertionError("waited in vain")

    def canvas(self) -> Pixels:
        """Pixels (h, w, 3) of the cloud's canvas."""
        self.settle()
        return pixels(base64.b64decode(self.page.evaluate("document.getElementById('canvas').toDataURL()")[22:]))

    def picture(self, selector: str) -> Pixels:
        """Pixels (h, w, 3) of an element on the screen."""
        self.settle()
        return pixels(self.page.locator(selector).first.screenshot())

    def style(self, selector: str, name: str) -> str:
        """Computed style of the first such element."""
        return str(self.page.locator(selector).first.evaluate(f"e => getComputedStyle(e).getPropertyValue('{name}')"))

    def words(self, selector: str) -> str:
        """Text of the first such element."""
        return str(self.page.locator(selector).first.inner_text()).strip()

    def middle(self, selector: str) -> tuple[float, float]:
        """Where the middle of an element is, after it was scrolled into view."""
        found = self.page.locator(selector).first
        found.scroll_into_view_if_needed()
        box = found.bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def drag(self, dx: float, dy: float, *, button: str = "left") -> None:
        """Drag the cloud."""
        x, y = self.middle("#canvas")
        self.page.mouse.move(x, y)
        self.page.mouse.down(button=button)
        self.page.mouse.move(x + dx / 2, y + dy / 2)
        self.page.mouse.move(x + dx, y + dy)
        self.page.mouse.up(button=button)


def pixels(png: bytes) -> Pixels:
    return np.asarray(Image.open(BytesIO(png)).convert("RGB")).astype(np.int64)


def differing(a: Pixels, b: Pixels) -> float:
    """Share of pixels that differ clearly."""
    return float((np.abs(a - b).max(axis=2) > 24).mean())


def of_ground(picture: Pixels) -> int:
    """Pixels that are green as ground is, however dark."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    return int(((red < 12) & (blue < 12) & (green > 40)).sum())


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"needs a browser, one of {', '.join(BROWSERS)}: apt-get install chromium")
    with sync_api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=found, headless=True, args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def path(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return page_of(small_run, tmp_path_factory)


@pytest.fixture(scope="module")
def text(path: Path) -> Page:
    return Page(path)


@pytest.fixture
def tab(browser: Any, path: Path) -> Iterator[Tab]:
    opened = Tab(browser, path)
    yield opened
    opened.close()


# ---------------------------------------------------------------------------------------------------------------------
# Images


def test_tags_can_be_switched_off_and_on_with_mouse_and_keyboard(tab: Tab) -> None:
    both = tab.picture(".pair.A .eye")
    assert tab.style(".pair.A .tag", "opacity") == "0.55"
    tab.page.locator("label.switch").click()
    assert tab.style(".pair.A .tag", "opacity") == "0"
    photo = tab.picture(".pair.A .eye")
    assert differing(both, photo) > 0.5
    tab.page.locator("#tags-on").focus()
    tab.page.keyboard.press("Space")
    assert tab.style(".pair.A .tag", "opacity") == "0.55"
    assert differing(tab.picture(".pair.A .eye"), both) == 0.0


def test_the_slider_mixes_photograph_and_tags(tab: Tab) -> None:
    tab.page.locator("#tags-opacity").focus()
    tab.page.keyboard.press("End")
    assert tab.words("#tags-value") == "100 %"
    full = tab.picture(".pair.A .eye")
    colours = np.array([row.rgb for row in CLASSES if row.rgb])
    exact = (np.abs(full[:, :, None] - colours).max(axis=3) == 0).any(axis=2)
    assert exact.mean() > 0.9  # but for corners and the word in the corner
    tab.page.keyboard.press("Home")
    assert tab.style(".pair.A .tag", "opacity") == "0"
    box = tab.page.locator("#tags-opacity").bounding_box()
    tab.page.mouse.click(box["x"] + box["width"] * 0.25, box["y"] + box["height"] / 2)
    assert 0.2 < float(tab.style(".pair.A .tag", "opacity")) < 0.3
    quarter = tab.picture(".pair.A .eye")
    assert 0.0 < differing(quarter, full) <= 1.0


def test_another_instant_is_chosen_by_its_small_picture_or_the_arrow_keys(tab: Tab, text: Page) -> None:
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


def test_the_class_under_the_pointer_is_named(tab: Tab, text: Page) -> None:
    tag = pixels(base64.b64decode(text.images("image/png")[0]))
    names = {row.rgb: row.name for row in CLASSES}
    tab.page.locator(".pair.A .eye").first.scroll_into_view_if_needed()
    box = tab.page.locator(".pair.A .eye").first.bounding_box()
    seen = set()
    for row, column in [(20, 160), (170, 160), (95, 20), (150, 40), (60, 250), (110, 300)]:
        x = box["x"] + (column + 0.5) / 320 * box["width"]
        y = box["y"] + (row + 0.5) / 184 * box["height"]
        tab.page.mouse.move(x, y)
        assert tab.words("#under") == names[tuple(tag[row, column])]
        seen.add(tab.words("#under"))
    assert len(seen) > 2


# ---------------------------------------------------------------------------------------------------------------------
# The cloud


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


def test_fingers_turn_and_zoom_the_cloud(browser: Any, path: Path) -> None:
    tab = Tab(browser, path, viewport={"width": 400, "height": 800}, has_touch=True, is_mobile=True)
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


def test_without_webgl_a_still_picture_stays(browser: Any, path: Path, tmp_path: Path) -> None:
    opened = browser.new_context(viewport={"width": 1000, "height": 900})
    opened.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page = opened.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(path.as_uri())
    assert page.locator("#canvas").is_hidden()
    still = pixels(page.locator("#screen").screenshot())
    assert of_ground(still) > 0.015 * still.shape[0] * still.shape[1]
    assert errors == []
    opened.close()


# ---------------------------------------------------------------------------------------------------------------------
# Curves


def test_pointing_at_a_curve_tells_time_and_values_of_all_curves_and_moves_the_robot(tab: Tab, text: Page) -> None:
    numbers = text.data("numbers")
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
    _, left, top = min(numbers["way"], key=lambda row: abs(row[0] - at))
    assert moved["x"] + moved["width"] / 2 == pytest.approx(sheet["x"] + left / 100 * sheet["width"], abs=1.0)
    assert moved["y"] + moved["height"] / 2 == pytest.approx(sheet["y"] + top / 100 * sheet["height"], abs=1.0)
    assert moved["x"] > robot["x"]


def test_time_moves_by_keys(tab: Tab, text: Page) -> None:
    tab.page.locator("#time").focus()
    tab.page.keyboard.press("End")
    assert tab.words("#time-value") == "1.20 s"
    last = text.data("numbers")["curves"]["speed"][0][1][-1]
    assert tab.words(".curve[data-key=speed] .reading") == str(last)


def test_a_curve_is_drawn_over_its_ticks(tab: Tab) -> None:
    """Ticks are words and the curve is a picture: both must be stretched alike."""
    box = tab.page.locator(".curve[data-key=speed] .plot").bounding_box()
    ticks = tab.page.locator(".curve[data-key=speed] .y")
    places = {float(tick.inner_text()): tick.bounding_box() for tick in ticks.all()}
    lines = tab.page.locator(".curve[data-key=speed] svg line[x1='0'][x2='1000']").all()
    heights = sorted(line.bounding_box()["y"] for line in lines)
    assert heights == pytest.approx(sorted(b["y"] + b["height"] / 2 for b in places.values()), abs=1.2)
    assert max(b["x"] + b["width"] for b in places.values()) <= box["x"]


# ---------------------------------------------------------------------------------------------------------------------
# The page as a whole


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1280])
def test_the_page_fits_and_can_be_read(browser: Any, path: Path, scheme: str, width: int) -> None:
    tab = Tab(browser, path, viewport={"width": width, "height": 800}, color_scheme=scheme)
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


def test_everything_that_can_be_used_is_reached_by_the_tab_key(tab: Tab) -> None:
    reached = set()
    for _ in range(120):
        tab.page.keyboard.press("Tab")
        where = tab.page.evaluate("(e => e.id || e.name || e.className || e.tagName)(document.activeElement)")
        if where == "BODY":
            break
        reached.add(where)
    assert {"skip", "tags-on", "tags-opacity", "pair-A", "canvas", "colour", "all", "home", "time", "copy"} <= reached


def test_code_is_copied(tab: Tab) -> None:
    tab.context.grant_permissions(["clipboard-read", "clipboard-write"])
    button = tab.page.locator(".forms .copy").nth(2)
    button.click()
    tab.until(lambda: button.inner_text() == "Copied")
    assert tab.page.evaluate("navigator.clipboard.readText()") == "fieldtruth export park_1.bag --to semantickitti"


def test_without_scripts_the_page_is_still_there(browser: Any, path: Path) -> None:
    tab = Tab(browser, path, java_script_enabled=False)
    both = pixels(tab.page.locator(".pair.A .eye").first.screenshot())
    tab.page.locator("label.switch").click()
    assert differing(both, pixels(tab.page.locator(".pair.A .eye").first.screenshot())) > 0.5
    tab.page.locator("label[for=pair-B]").click()
    assert tab.page.locator(".pair.B").is_visible()
    assert not tab.page.locator(".pair.A").is_visible()
    assert tab.page.locator(".poster").is_visible()
    assert tab.page.locator(".copy").first.is_hidden()
    tab.context.close()
    assert tab.requests == [path.as_uri()]


def test_all_pairs_are_printed_and_nothing_to_click(tab: Tab) -> None:
    tab.page.emulate_media(media="print")
    assert all(pair.is_visible() for pair in tab.page.locator(".pair").all())
    assert tab.page.locator(".poster").is_visible()
    for selector in ("nav", "#canvas", "#tag-controls", ".copy", ".strip", "#home"):
        assert tab.page.locator(selector).first.is_hidden(), selector


def test_hostile_names_do_nothing(browser: Any, small_run: Path, tmp_path: Path) -> None:
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
