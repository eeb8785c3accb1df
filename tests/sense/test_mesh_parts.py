# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Trees are traced as trunk and crown; class, instance id and range are those of the whole tree."""

import numpy as np
import pytest
from sense_worlds import BOX_CORNERS, BOX_FACES, at, box, floating, make_mesh, trace_rays

from fieldtruth.core.classes import Label
from fieldtruth.sense.scene import parts_of
from fieldtruth.world.model import Mesh

CROWN = BOX_CORNERS * (3.0, 3.0, 1.0) + (0.0, 0.0, 7.0)
TRUNK = BOX_CORNERS * (0.2, 0.2, 2.95) + (0.0, 0.0, 2.95)


@pytest.fixture(scope="module")
def tree() -> Mesh:
    """Faces of the crown between those of the trunk, to which the parts must not be sorted."""
    faces = np.concatenate([BOX_FACES[:6] + 8, BOX_FACES, BOX_FACES[6:] + 8])
    return make_mesh("tree", np.concatenate([CROWN, TRUNK]), faces, ["bark"] * 6 + ["leaf"] * 12 + ["bark"] * 6)


def test_a_tree_is_divided_below_its_crown_and_a_box_is_not(tree: Mesh) -> None:
    trunk, crown = parts_of(tree)
    np.testing.assert_array_equal(trunk, ~crown)
    np.testing.assert_array_equal(crown, [False] * 6 + [True] * 12 + [False] * 6)
    (whole,) = parts_of(box("block", (1.0, 1.0, 1.0)))
    assert whole.all()
    assert len(parts_of(make_mesh("leaf", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))) == 1


def test_parts_are_one_object(tree: Mesh) -> None:
    """Behind the tree stands a box, whose row of the scene is not its geometry's id."""
    scene = floating((tree, at(10.0, 0.0, 0.0)), (box("block", (1.0, 9.0, 9.0)), at(20.0, 0.0, 9.0)))
    assert scene.hits.geometry_top.tolist() == [0, 1, 1, 2]
    origins = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 7.5], [0.0, 2.5, 6.5], [0.0, 2.5, 2.0], [0.0, 0.0, 8.5]])
    found = trace_rays(scene, origins, np.tile([1.0, 0.0, 0.0], (5, 1)))
    np.testing.assert_allclose(found.range_m, [9.8, 7.0, 7.0, 19.0, 19.0], atol=1e-5)
    assert found.label.tolist() == [Label.TRUNK, Label.TREETOP, Label.TREETOP, Label.ROCK, Label.ROCK]
    assert found.instance.tolist() == [2, 2, 2, 3, 3]
