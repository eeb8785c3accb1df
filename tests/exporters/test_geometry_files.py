# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Files of normals and flow, as OpenCV and KITTI's formula read them."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from fieldtruth.exporters.image_files import flow_flo, flow_png, normals_png
from fieldtruth.report.drawing.images import flow_colours, normal_colours

SHAPE = (5, 7)


def test_normals_are_read_to_a_thirty_thousandth(tmp_path: Path) -> None:
    normal = np.random.default_rng(0).standard_normal((*SHAPE, 3)).astype(np.float32)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    normal[0, :3], normal[0, 3] = np.eye(3), [0.0, 0.0, -1.0]
    normal[1, 1] = 0.0
    (tmp_path / "a.png").write_bytes(normals_png(normal))
    samples = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    assert samples is not None
    assert samples.shape == (*SHAPE, 3)
    assert samples.dtype == np.uint16
    found = (samples[..., ::-1].astype(float) - 32768) / 32767
    assert np.abs(found - normal).max() <= 0.5 / 32767 + 1e-7
    assert found[0, :4].tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1]]
    assert not found[1, 1].any()


def test_flow_as_kittis_devkit_and_middleburys_reader_have_it(tmp_path: Path) -> None:
    flow = np.random.default_rng(1).uniform(-400.0, 400.0, (*SHAPE, 2)).astype(np.float32)
    flow[0, 0], flow[0, 1], flow[0, 2] = np.nan, (600.0, 0.0), (0.0, 0.0)
    (tmp_path / "a.png").write_bytes(flow_png(flow))
    samples = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    assert samples is not None
    known = samples[..., 0] == 1  # OpenCV has blue first
    found = (samples[..., :0:-1].astype(float) - 2**15) / 64.0
    assert (~known).sum() == 2
    assert not known[0, :2].any()
    assert np.abs(found - flow)[known].max() <= 0.5 / 64.0
    (tmp_path / "a.flo").write_bytes(flow_flo(flow))
    exact = cv2.readOpticalFlow(str(tmp_path / "a.flo"))
    assert exact[0, 0].min() > 1e9
    exact[0, 0] = np.nan
    assert np.array_equal(exact, flow, equal_nan=True)


def test_colours_show_direction_and_length() -> None:
    flow = np.array([[[3.0, 0.0], [-3.0, 0.0], [0.0, 0.0], [np.nan, np.nan]]], np.float32)
    red, cyan, white, black = flow_colours(flow)[0].tolist()
    assert (red, cyan, white, black) == ([255, 0, 0], [0, 255, 255], [255, 255, 255], [0, 0, 0])
    normal = np.array([[[1, 0, 0], [0, 0, -1], [0, 0, 0]]], np.float32)
    assert normal_colours(normal)[0].tolist() == pytest.approx(
        np.array([[255, 128, 128], [128, 128, 0], [0, 0, 0]]), abs=1
    )
