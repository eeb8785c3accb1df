# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A changed pixel is found: by its colour, its object, its depth, and what only the world can tell by a retrace."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from validate_bags import Change, Edit, each, failures, first_message, only, pixels_in, quick_failures, rewritten

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.classes import PALETTE, Label
from fieldtruth.validation import Check

Validate = Callable[..., list[Check]]
TAG, DEPTH, IDS = table.tag("left"), table.depth("left"), table.instances("left")


def painted(row: int, column: int, colour: tuple[int, int, int]) -> Edit:
    """Paint a pixel of a tag image."""

    def edit(data: bytearray) -> None:
        pixels_in(data, "u1", 3)[row, column] = colour

    return edit


def seen(run: Path, label: Label) -> tuple[int, int]:
    """A pixel of a class in the left camera's first tag image."""
    tags = pixels_in(bytearray(first_message(run, TAG).data), "u1", 3)
    row, column = np.argwhere((tags == PALETTE[label]).all(axis=-1))[100]
    return int(row), int(column)


def found(run: Path, target: Path, change: Change) -> dict[str, str]:
    return quick_failures(rewritten(run, target, change))


def test_colours_that_no_class_has_are_found(lean_run: Path, tmp_path: Path) -> None:
    """Each is one step, or one channel, from the colour of a class."""
    colours = [(0, 0, 1), (255, 0, 128), (126, 127, 127), (254, 255, 255)]
    change = each({(TAG, 5 + k): painted(183, 319, colour) for k, colour in enumerate(colours)})
    text = found(lean_run, tmp_path, change)["tag colours"]
    assert f"4 of {26 * 184 * 320:,}" in text
    assert "240000000 ns, row 183, column 319: 0 0 1" in text


def test_a_class_that_its_object_cannot_have_is_found(lean_run: Path, tmp_path: Path) -> None:
    row, column = seen(lean_run, Label.TREETOP)
    text = found(lean_run, tmp_path, only(TAG, 0, painted(row, column, (255, 0, 0))))["objects"]
    assert f"40000000 ns, row {row}, column {column}: 'large_tree" in text
    assert "of class 'rock'" in text


def test_sky_in_front_of_a_thing_is_found_by_object_and_by_depth(lean_run: Path, tmp_path: Path) -> None:
    row, column = seen(lean_run, Label.TREETOP)
    texts = found(lean_run, tmp_path, only(TAG, 0, painted(row, column, (127, 127, 127))))
    assert set(texts) == {"objects", "depth and ids"}


def test_depths_that_cannot_be_are_found(lean_run: Path, tmp_path: Path) -> None:
    ground, sky = seen(lean_run, Label.GROUND), seen(lean_run, Label.SKY)

    def deep(pixel: tuple[int, int], metres: float) -> Edit:
        def edit(data: bytearray) -> None:
            pixels_in(data, "<f4")[pixel] = metres

        return edit

    wrong = [deep(ground, metres) for metres in (0.0, -1.0, np.inf, np.nan, 2001.0)] + [deep(sky, 100.0)]
    text = found(lean_run, tmp_path, each({(DEPTH, k): edit for k, edit in enumerate(wrong)}))["depth and ids"]
    assert f"6 of {26 * 184 * 320:,}" in text
    assert f"40000000 ns, row {ground[0]}, column {ground[1]}: 0 m on a thing" in text


def test_an_object_that_there_is_not_is_found(lean_run: Path, tmp_path: Path) -> None:
    """One number beyond the last; and none, where a thing is."""
    leaf = seen(lean_run, Label.TREETOP)

    def beyond(data: bytearray) -> None:
        pixels_in(data, "<u2")[100, 100] = 141

    def none(data: bytearray) -> None:
        pixels_in(data, "<u2")[leaf] = 0

    texts = found(lean_run, tmp_path, each({(IDS, 3): beyond, (IDS, 0): none}))
    assert "object 141 of 141" in texts["depth and ids"]
    assert f"row {leaf[0]}, column {leaf[1]}: object 0 is of class 'treetop'" in texts["objects"]


def test_what_only_the_world_can_tell_is_found_by_a_full_retrace(
    lean_run: Path, tmp_path: Path, with_world: Validate
) -> None:
    """A leaf that is called wood, ground that is called trail, depth that is 1 cm too long, a leaf of another tree.

    And a photograph of another moment. Each is right by every law but that of the place.
    """
    leaf, ground = seen(lean_run, Label.TREETOP), seen(lean_run, Label.GROUND)
    photo = first_message(lean_run, table.photograph("right")).data

    def deeper(data: bytearray) -> None:
        depths: NDArray[np.float32] = pixels_in(data, "<f4")
        depths[ground] += np.float32(0.01)

    def of_another_tree(data: bytearray) -> None:
        ids = pixels_in(data, "<u2")
        ids[leaf] = 60 if ids[leaf] != 60 else 61

    edits: dict[tuple[str, int], Edit] = {
        (IDS, 3): of_another_tree,
        (TAG, 0): painted(*leaf, (255, 0, 255)),
        (TAG, 1): painted(*ground, (76, 57, 48)),
        (DEPTH, 2): deeper,
    }

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        if raw.topic == table.photograph("right") and k == 9:
            return raw._replace(data=raw.data[:12] + photo[12:])
        return each(edits)(raw, k)

    folder = rewritten(lean_run, tmp_path, change)
    assert quick_failures(folder) == {}
    texts = failures(with_world(folder, full=True, samples=1))
    assert set(texts) == {"retraced images", "photographs"}
    assert f"4 of {26 * 184 * 320:,} break this" in texts["retraced images"]
    assert f"row {leaf[0]}, column {leaf[1]}: class 2 of object" in texts["retraced images"]
    assert "right/real/compressed at 400000000 ns" in texts["photographs"]
    assert "1 of 26" in texts["photographs"]


def test_a_photograph_that_cannot_be_unpacked_is_found(lean_run: Path, tmp_path: Path) -> None:
    def headless(data: bytearray) -> None:
        data[bytes(data).index(b"\xff\xd8")] = 0

    assert "whole JPEG" in found(lean_run, tmp_path, only(table.photograph("left"), 4, headless))["pictures"]


def test_an_image_of_another_size_is_found(lean_run: Path, tmp_path: Path) -> None:
    def narrower(data: bytearray) -> None:
        """Declare 368 rows of half the length."""
        at = bytes(data).index(b"left_camera_optical") + len("left_camera_optical")
        for offset, value in ((0, 368), (4, 160)):
            data[at + offset : at + offset + 4] = value.to_bytes(4, "little")
        step = at + 8 + 4 + len("rgb8") + 1
        data[step : step + 4] = (3 * 160).to_bytes(4, "little")

    text = found(lean_run, tmp_path, only(TAG, 6, narrower))["pictures"]
    assert "160 x 368 rgb8, CameraInfo says (320, 184)" in text
