# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The page as a file: valid, self-contained, bounded in size, written whole or not at all."""

import ast
import base64
import re
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from report_pages import (
    POINTS,
    TAGS,
    Page,
    longer,
    only,
    words,
)

from fieldtruth import cli
from fieldtruth.bag import reader
from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import open_run
from fieldtruth.core.errors import OutputError
from fieldtruth.core.progress import Silent
from fieldtruth.exporters import FORMATS
from fieldtruth.report import page as report_page
from fieldtruth.report.drawing.images import jpeg_below
from fieldtruth.report.page import LARGEST_PAGE, bag_pass, cloud, collect_content, render_page, write_report
from fieldtruth.report.page import map as map_figure
from fieldtruth.report.page.bag_pass import summarize_bag


def test_page_is_valid_html_and_self_contained(page: Page) -> None:
    ids = [element.get("id") for element in page.root.iter() if element.get("id")]
    assert len(ids) == len(set(ids))
    for element in page.root.iter():
        for name in ("src", "href", "data", "poster", "action", "srcset", "{http://www.w3.org/1999/xlink}href"):
            value = element.get(name, "data:")
            assert value.startswith("data:") or (value[:1] == "#" and value[1:] in ids), (element.tag, name, value[:50])
    assert not re.search(r"url\(|@import|https?://(?!www\.w3\.org)", page.text)
    assert not {"link", "iframe", "object", "embed", "base"} & {
        str(e.tag) for e in page.root.iter() if e.get("href") != "data:,"
    }
    policy = page.one(".//meta[@http-equiv='Content-Security-Policy']").get("content", "")
    assert policy.startswith("default-src 'none'; img-src data:;")
    assert "unsafe-inline" not in policy.split("script-src")[1]


def test_inputs_have_labels_and_images_have_alt_texts(page: Page) -> None:
    labelled = {label.get("for") for label in page.root.iter("label")} | {
        element.get("id") for label in page.root.iter("label") for element in label.iter("input")
    }
    wrapped = {id(element) for label in page.root.iter("label") for element in label.iter("input")}
    for element in page.root.iter("input"):
        assert id(element) in wrapped or element.get("id") in labelled
    assert all(image.get("alt") is not None for image in page.root.iter("img"))
    assert all(svg.get("aria-label") for svg in page.root.findall(".//{*}svg"))
    assert page.root.get("lang") == "en"
    levels = [int(str(e.tag)[1]) for e in page.root.iter() if re.fullmatch("h[1-6]", str(e.tag))]
    assert levels[0] == 1
    assert max(np.diff(levels)) == 1


def test_size_of_any_page_is_below_15_mb(page: Page) -> None:
    """Every large part has a limit in bytes or in number; with half a megabyte of text, the sum is below the limit."""
    images = report_page.SAMPLES * (2 * (report_page.PHOTO_BYTES + report_page.TAG_BYTES) + report_page.THUMBNAIL_BYTES)
    points = 7 * (cloud.LARGEST + cloud.PATH_POINTS) + cloud.POSTER_BYTES
    vertex = len("9999.9,99.99L") + len("9999999,") + len("-1.2345e-05,")  # in the SVG path and in the values
    curves = bag_pass.CHANNELS * bag_pass.VERTICES * vertex
    positions = map_figure.VERTICES * (len("9999.9,9999.9 ") + len("[99999999,99.99,99.99],"))
    assert 4 / 3 * (images + points + map_figure.PHOTO_BYTES) + curves + 2 * positions + 500_000 < LARGEST_PAGE
    assert sum(len(channels) for channels in page.data("numbers")["curves"].values()) == 18
    assert all(len(base64.b64decode(p)) <= report_page.TAG_BYTES for p in page.images("image/png"))
    rest = re.sub(r"base64,[A-Za-z0-9+/=]+|(?<=cloud-data\">)[^<]*|(?<= d=\")[^\"]*", "", page.text)
    rest = re.sub(r"(?<=id=\"numbers\">)[^<]*", "", rest)
    assert len(rest) < 150_000


def test_jpeg_of_a_large_noisy_image_is_below_the_limit() -> None:
    noise = np.random.default_rng(5).integers(0, 256, (1080, 1920, 3), np.uint8)
    assert len(jpeg_below(noise, report_page.PHOTO_BYTES)) <= report_page.PHOTO_BYTES


def test_snippets_run_and_commands_exist(
    page: Page, small_run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(small_run)
    code = {
        words(figure.find("figcaption/b")): "".join(figure.find("pre").itertext())  # type: ignore[arg-type, union-attr]
        for figure in page.root.findall(".//figure[@class='snippet']")
    }
    for title in ("fieldtruth", "rosbags, without ROS", "PyTorch"):
        exec(compile(ast.parse(code[title]), title, "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) > 12
    assert printed[0].startswith("100000000 ")
    commands = [words(code) for code in page.root.findall(".//dl[@class='exports']//code")]
    assert commands == [f"fieldtruth export park_1.bag --to {form}" for form in FORMATS]
    assert code["Validate"] == "sha256sum -c SHA256SUMS\nfieldtruth validate park_1.bag"
    assert code["evo"] == "evo_traj bag park_1.bag /ground_truth/odom --plot"


def test_page_does_not_depend_on_the_number_of_threads(small_run: Path, tmp_path: Path) -> None:
    bag = only(small_run / "park_1.bag", tmp_path / "some.bag", TAGS[0], POINTS, "/imu/data")
    one, many = (render_page(collect_content(open_run(bag), workers, Silent())) for workers in (1, 5))
    assert one == many


@pytest.mark.slow
def test_memory_does_not_grow_with_the_run(small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader._RECENT, "budget", 0)  # the last chunk only, instead of 16 MB
    bag = only(small_run / "park_1.bag", tmp_path / "short.bag", TAGS[0], POINTS, "/imu/data", "/navsat/fix")
    peaks = []
    for number in (1, 2, 8):
        run = open_run(longer(bag, tmp_path / f"{number}.bag", number))
        tracemalloc.start()
        found = summarize_bag(run, 2, Silent())
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert found.pixels[TAGS[0]].sum() == number * 30 * 160 * 92
    assert peaks[2] < 1.5 * peaks[1]  # for four times the messages; the threads are not always equally far ahead


def test_existing_page_is_replaced_only_with_overwrite(
    small_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = only(small_run / "park_1.bag", tmp_path / "some.bag", "/imu/data")
    assert cli.main(["report", str(bag)]) == 0
    made = tmp_path / "some_report.html"
    assert capsys.readouterr().out.startswith(f"{made}: 0.")
    made.write_text("mine")
    assert cli.main(["report", str(bag)]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"error: {made} already exists; choose another --out, or use --overwrite to replace it"
    ]
    assert made.read_text() == "mine"
    assert cli.main(["report", str(bag), "--overwrite"]) == 0
    assert made.read_text().startswith("<!DOCTYPE html>")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["some.bag", "some_report.html"]


@pytest.mark.parametrize(
    ("out", "says"),
    [
        ("page.pdf", "must end in .html or .htm"),
        ("none/page.html", "does not exist"),
        ("folder.html", "is a folder"),
    ],
)
def test_invalid_page_paths_are_errors(small_run: Path, tmp_path: Path, out: str, says: str) -> None:
    (tmp_path / "folder.html").mkdir()
    with pytest.raises(OutputError, match=re.escape(says)):
        write_report(small_run, out=tmp_path / out)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder.html"]


def test_damaged_bag_makes_no_page(small_run: Path, tmp_path: Path) -> None:
    whole = (small_run / "park_1.bag").read_bytes()
    for name, data in {"cut": whole[: len(whole) // 2], "empty": b"", "foreign": b"PK\x03\x04" + b"\0" * 5000}.items():
        bag = tmp_path / f"{name}.bag"
        bag.write_bytes(data)
        with pytest.raises(BagError):
            write_report(bag)
    assert not list(tmp_path.glob("*.html*"))
    assert not list(tmp_path.glob(".*"))
