# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A changed pixel is found: by its colour, its object, its depth, or by rendering the image again."""

from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from changed_bags import (
    LEFT,
    RIGHT,
    Edit,
    Edits,
    bag_in,
    edited,
    failures,
    failures_of,
    first_message,
    pixels_in,
    rewritten,
)
from numpy.typing import NDArray

from fieldtruth.bag.geometry import ModelStatesReader
from fieldtruth.bag.reader import RawMessage, open_bag
from fieldtruth.bag.topics import MODEL_STATES
from fieldtruth.core.classes import PALETTE, Label
from fieldtruth.validation.runner import validate

TAG, DEPTH, IDS = LEFT.topic_of("tag"), LEFT.topic_of("depth"), LEFT.topic_of("instances")
ALL_PIXELS = f"{26 * 184 * 320:,}"


def painted(row: int, column: int, colour: tuple[int, int, int]) -> Edit:
    """Paint a pixel of a tag image."""

    def edit(data: bytearray) -> None:
        pixels_in(data, "u1", 3)[row, column] = colour

    return edit


def deep(pixel: tuple[int, int], metres: float) -> Edit:
    """Set a pixel of a depth image."""

    def edit(data: bytearray) -> None:
        pixels_in(data, "<f4")[pixel] = metres

    return edit


def owned(pixel: tuple[int, int], number: int) -> Edit:
    """Set a pixel of an instance image."""

    def edit(data: bytearray) -> None:
        pixels_in(data, "<u2")[pixel] = number

    return edit


def pixel_of(run: Path, label: Label) -> tuple[int, int]:
    """A pixel that has a class in each of the left camera's first four tag images."""
    with open_bag(bag_in(run)) as bag:
        tags = [pixels_in(bytearray(raw.data), "u1", 3) for raw in islice(bag.messages([TAG]), 4)]
    row, column = np.argwhere((np.stack(tags) == PALETTE[label]).all(axis=(0, -1)))[100]
    return int(row), int(column)


@pytest.fixture(scope="module")
def leaf(lean_run: Path) -> tuple[int, int]:
    return pixel_of(lean_run, Label.TREETOP)


@pytest.fixture(scope="module")
def ground(lean_run: Path) -> tuple[int, int]:
    return pixel_of(lean_run, Label.GROUND)


@pytest.fixture(scope="module")
def objects(lean_run: Path) -> int:
    """Number of ids, with that of sky and robot."""
    reader = ModelStatesReader()
    reader.poses(first_message(lean_run, MODEL_STATES).data)
    return len(reader.names)


@pytest.fixture(scope="module")
def impossible(
    lean_run: Path,
    tmp_path_factory: pytest.TempPathFactory,
    leaf: tuple[int, int],
    ground: tuple[int, int],
    objects: int,
) -> dict[str, str]:
    """Failed checks of images with pixels that no camera of this package renders."""

    def headless(data: bytearray) -> None:
        data[bytes(data).index(b"\xff\xd8")] = 0

    def narrower(data: bytearray) -> None:
        """Declare 368 rows of half the length."""
        at = bytes(data).index(b"left_camera_optical") + len("left_camera_optical")
        for offset, value in ((0, 368), (4, 160)):
            data[at + offset : at + offset + 4] = value.to_bytes(4, "little")
        step = at + 8 + 4 + len("rgb8") + 1
        data[step : step + 4] = (3 * 160).to_bytes(4, "little")

    # Each colour is one step, or one channel, from that of a class.
    colours = [(0, 0, 1), (255, 0, 128), (126, 127, 127), (254, 255, 255)]
    edits: Edits = {(TAG, 5 + k): painted(183, 319, colour) for k, colour in enumerate(colours)}
    depths = (0.0, -1.0, np.inf, np.nan, 2001.0)
    edits |= {(DEPTH, k): deep(ground, metres) for k, metres in enumerate(depths)}
    edits |= {
        (DEPTH, 5): deep(pixel_of(lean_run, Label.SKY), 100.0),
        (TAG, 0): painted(*leaf, (255, 0, 0)),  # rock
        (IDS, 3): owned((100, 100), objects),  # beyond the last object
        (TAG, 10): narrower,
        (LEFT.topic_of("photograph"), 4): headless,
    }
    return failures_of(lean_run, tmp_path_factory.mktemp("impossible"), edits)


def test_colours_of_no_class_are_found(impossible: dict[str, str]) -> None:
    assert "4 of" in impossible["tag colours"]
    assert "240000000 ns, row 183, column 319: 0 0 1" in impossible["tag colours"]


def test_depths_that_contradict_the_class_are_found(impossible: dict[str, str], ground: tuple[int, int]) -> None:
    assert f"40000000 ns, row {ground[0]}, column {ground[1]}: 0 m on an object" in impossible["depth"]
    assert ": 6 of" in impossible["depth"]


def test_class_that_the_object_cannot_have_and_an_unknown_object_are_found(
    impossible: dict[str, str], leaf: tuple[int, int]
) -> None:
    assert ": 2 of" in impossible["object classes"]
    assert f"40000000 ns, row {leaf[0]}, column {leaf[1]}: object" in impossible["object classes"]
    assert "('large_tree" in impossible["object classes"]
    assert "has the class 'rock'" in impossible["object classes"]


def test_photograph_that_cannot_be_decoded_and_image_of_another_size_are_found(impossible: dict[str, str]) -> None:
    size, jpeg = impossible["images"].split("; ")
    assert "160 x 368 rgb8, CameraInfo has (320, 184)" in size
    assert jpeg.startswith("photographs can be decoded: 1 of 26")


def test_sky_on_an_object_is_found_by_object_and_by_depth(
    lean_run: Path, tmp_path: Path, leaf: tuple[int, int]
) -> None:
    texts = failures_of(lean_run, tmp_path, {(TAG, 0): painted(*leaf, (127, 127, 127))})
    assert set(texts) == {"object classes", "depth"}


def test_objects_that_do_not_exist_are_found(
    lean_run: Path, tmp_path: Path, leaf: tuple[int, int], objects: int
) -> None:
    """No object on a leaf; then an id beyond the last one."""
    texts = failures_of(lean_run, tmp_path, {(IDS, 0): owned(leaf, 0), (IDS, 3): owned((100, 100), objects)})
    assert list(texts) == ["object classes"]
    assert f"row {leaf[0]}, column {leaf[1]}: object 0 has the class 'treetop'" in texts["object classes"]
    texts = failures_of(lean_run, tmp_path / "beyond", {(IDS, 3): owned((100, 100), objects)})
    assert f"160000000 ns, row 100, column 100: object {objects} of {objects}" in texts["object classes"]


@pytest.mark.slow
@pytest.mark.usefixtures("in_park")
def test_pixels_that_only_the_world_contradicts_are_found_by_full_retracing(
    lean_run: Path, tmp_path: Path, leaf: tuple[int, int], ground: tuple[int, int]
) -> None:
    """A leaf labelled wood, ground labelled trail, depth 1 cm too long, a leaf of another tree.

    And a photograph of another stamp. No other check detects them.
    """
    photo = first_message(lean_run, RIGHT.topic_of("photograph")).data

    def deeper(data: bytearray) -> None:
        depths: NDArray[np.float32] = pixels_in(data, "<f4")
        depths[ground] += np.float32(0.01)

    def of_another_tree(data: bytearray) -> None:
        ids = pixels_in(data, "<u2")
        ids[leaf] = 60 if ids[leaf] != 60 else 61

    edits: Edits = {
        (IDS, 3): of_another_tree,
        (TAG, 0): painted(*leaf, (255, 0, 255)),
        (TAG, 1): painted(*ground, (76, 57, 48)),
        (DEPTH, 2): deeper,
    }

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        if raw.topic == RIGHT.topic_of("photograph") and k == 9:
            return raw._replace(data=raw.data[:12] + photo[12:])
        return edited(edits)(raw, k)

    folder = rewritten(lean_run, tmp_path, change)
    assert failures(validate(folder, quick=True)) == {}
    texts = failures(validate(folder, full=True, samples=1))
    assert set(texts) == {"retraced images", "photographs"}
    assert f"4 of {ALL_PIXELS} mismatch" in texts["retraced images"]
    assert f"row {leaf[0]}, column {leaf[1]}: class 2 of object" in texts["retraced images"]
    assert "right/real/compressed at 400000000 ns" in texts["photographs"]
    assert "1 of 26" in texts["photographs"]
