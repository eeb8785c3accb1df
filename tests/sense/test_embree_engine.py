# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The engine refuses an Embree that is not the one the kernels were written for, and says what it found."""

import pytest

from fieldtruth.core.errors import EngineError
from fieldtruth.sense import embree


def test_this_machines_engine_starts() -> None:
    assert embree.Engine().device
    assert embree.LANES in (8, 16)


def test_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embree, "VERSION", 40300)
    with pytest.raises(EngineError, match=r"version 40400; this fieldtruth knows 40300"):
        embree.Engine()


@pytest.mark.parametrize(
    ("field", "other"),
    [
        ("ORG_X", "ORG_Y"), ("ORG_Z", "TNEAR"), ("DIR_Z", "DIR_Y"), ("TFAR", "MASK"), ("NG_Z", "NG_Y"),
        ("HIT_U", "HIT_V"), ("PRIM_ID", "GEOM_ID"), ("GEOM_ID", "INST_ID"), ("INST_ID", "INST_PRIM_ID"),
    ],
)  # fmt: skip
def test_another_layout_is_refused(monkeypatch: pytest.MonkeyPatch, field: str, other: str) -> None:
    """Two fields of the packet change places, as if the library had moved them."""
    first, second = getattr(embree, field), getattr(embree, other)
    monkeypatch.setattr(embree, field, second)
    monkeypatch.setattr(embree, other, first)
    with pytest.raises(EngineError, match="laid out otherwise"):
        embree.Engine()


def test_a_wrong_mesh_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """What Embree reports as an error becomes one of ours."""
    scene = embree.RayScene(embree.Engine())
    monkeypatch.setattr(embree, "_FLOAT3", 0x1234)
    with pytest.raises(EngineError, match="Embree reports error"):
        scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
