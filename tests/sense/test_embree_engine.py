# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The engine raises EngineError for an Embree that the kernels were not written for."""

import pytest

from fieldtruth.core.errors import EngineError
from fieldtruth.kernels import packets
from fieldtruth.sense import embree


def test_engine_starts() -> None:
    assert embree.Engine().device
    assert packets.LANES in (8, 16)


def test_other_version_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embree, "VERSION", 40300)
    with pytest.raises(EngineError, match="Embree must be version 40300, got 40400"):
        embree.Engine()


@pytest.mark.parametrize(
    ("field", "other"),
    [
        ("ORG_X", "ORG_Y"), ("ORG_Z", "TNEAR"), ("DIR_Z", "DIR_Y"), ("TFAR", "MASK"), ("NG_Z", "NG_Y"),
        ("HIT_U", "HIT_V"), ("PRIM_ID", "GEOM_ID"), ("GEOM_ID", "INST_ID"), ("INST_ID", "INST_PRIM_ID"),
    ],
)  # fmt: skip
def test_other_layout_is_rejected(monkeypatch: pytest.MonkeyPatch, field: str, other: str) -> None:
    """Two fields of the packet are swapped, as if the library had moved them."""
    first, second = getattr(packets, field), getattr(packets, other)
    monkeypatch.setattr(packets, field, second)
    monkeypatch.setattr(packets, other, first)
    with pytest.raises(EngineError, match="unexpected layout"):
        embree.Engine()


def test_embree_error_codes_are_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = embree.RayScene(embree.Engine())
    monkeypatch.setattr(embree, "_FLOAT3", 0x1234)
    with pytest.raises(EngineError, match="Embree reports error"):
        scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


def test_a_missing_library_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packets, "files", lambda _: [])
    monkeypatch.setattr(packets, "embree_library", packets.embree_library.__wrapped__)
    embree._library.cache_clear()
    with pytest.raises(EngineError, match="cannot find Embree 4 in the package embreex; run: pip install"):
        embree.Engine()
