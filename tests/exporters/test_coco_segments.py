# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Segment ids, areas and boxes against NumPy, run lengths against masks that pycocotools encodes from pixels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from pycocotools import mask as masks

from fieldtruth.exporters.coco import STUFF, Numbering, categories_of, segments_of
from fieldtruth.ontology import own_labels
from fieldtruth.world.build import load_world


def numbered(name: str) -> bool:
    return name.rsplit("_", 1)[-1].isdigit()


SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("lake", "forest", "hillside")]


@pytest.mark.parametrize("environment", ["park", *SLOW])
def test_only_names_of_single_objects_end_in_a_number(environment: str) -> None:
    world = load_world(environment, 0)
    assert all(numbered(instance.name) for instance in world.instances)
    for swarm in world.swarms:
        labels = {int(world.materials[name].label) for mesh in swarm.meshes for name in world.meshes[mesh].materials}
        assert labels <= STUFF or not numbered(swarm.name), swarm.name


def test_segment_ids_combine_category_and_object() -> None:
    """Classes that are not countable have no objects, even a lake, or reeds, a swarm with a number in its name."""
    names = ["husky", "lake_ground", "lake_1", "high_grass_reed_1", "cable_1", "cables_beyond", "meadow_tree_12"]
    numbering = Numbering(categories_of(own_labels()), own_labels(), names)
    rows = [(1, 1, 0), (7, 1, 0), (3, 1, 0), (14, 2, 0), (6, 3, 0), (13, 4, 4), (13, 5, 0), (2, 6, 6), (3, 6, 6),
            (15, 0, 0)]  # fmt: skip
    label, instance, single = np.array(rows).T
    numbers = numbering.number(label[None].astype(np.uint8), instance[None].astype(np.uint16))
    np.testing.assert_array_equal(numbers, (label * 65536 + single)[None])


@given(arrays(np.uint32, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.sampled_from([0, 1, 7, 1 << 20])))
def test_segments_match_encoded_masks(ids: NDArray[np.uint32]) -> None:
    assert_segments(ids)


@pytest.mark.parametrize(("height", "width"), [(720, 1280), (1, 5000), (5000, 1)])
def test_segments_with_long_runs_match_encoded_masks(height: int, width: int) -> None:
    """Run lengths that take one to five characters, of either sign."""
    rng = np.random.default_rng(height)
    ids = np.full((height, width), 3, np.uint32)
    assert_segments(ids)
    ids[-1, -1] = 9
    assert_segments(ids)
    for _ in range(20):
        row, column = rng.integers(0, height), rng.integers(0, width)
        ids[row : row + rng.integers(1, 400), column : column + rng.integers(1, 400)] = rng.integers(0, 5)
    assert_segments(ids)
    assert_segments(rng.integers(0, 40, (height, width)).astype(np.uint32))


def assert_segments(ids: NDArray[np.uint32]) -> None:
    segments = segments_of(ids)
    assert [segment.id for segment in segments] == [number for number in np.unique(ids).tolist() if number]
    for segment in segments:
        mask = ids == segment.id
        rows, columns = np.nonzero(mask)
        x, y = columns.min(), rows.min()
        assert segment.counts == masks.encode(np.asfortranarray(mask))["counts"].decode()
        assert segment.area == mask.sum()
        assert segment.bbox == [x, y, columns.max() - x + 1, rows.max() - y + 1]
