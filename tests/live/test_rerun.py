# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A live simulation in rerun: what its own server wrote into a file."""

import socket
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from live_runs import running, simulation_of, wait_for
from stepped_rigs import experiment

from fieldtruth.core.errors import OutputError

pytest.importorskip("rerun", reason="the viewer's package is not installed")
from fieldtruth.live.rerun import RerunSink
from fieldtruth.report.viewer import BASE


def free_port() -> int:
    with socket.socket() as each:
        each.bind(("127.0.0.1", 0))
        return int(each.getsockname()[1])


def test_a_server_hears_world_clouds_and_poses_of_two_beginnings(tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    file, port = tmp_path / "live.rrd", free_port()
    command = [sys.executable, "-m", "rerun", "--save", str(file), "--bind", "127.0.0.1", "--port", str(port)]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_for(lambda: socket.socket().connect_ex(("127.0.0.1", port)) == 0, seconds=60)
        with running(lambda _: RerunSink(port=port), rate=0.0) as (_, run):
            wait_for(lambda: run.simulation.seconds > 0.5, seconds=60)
            run.inbox.take("/fieldtruth/reset", "std_msgs/msg/Int64", SimpleNamespace(data=-1))
            wait_for(lambda: 0.25 < run.simulation.seconds < 0.5, seconds=60)
        track = run.simulation.track
    finally:
        server.terminate()
        server.wait(60)
    reader = RrdReader(str(file))
    _, second = [each for each in reader.recordings() if each.application_id == "fieldtruth"]
    rows = defaultdict[str, list[dict[str, Any]]](list)
    for chunk in reader.stream(store=second):
        for row in chunk.to_record_batch().to_pylist():
            rows[chunk.entity_path].append(row)
    poses = {row["time"].value: row["Transform3D:translation"][0] for row in rows[f"/{BASE}"]}
    stamp = max(poses)
    k = np.searchsorted(track.motion.stamps_ns, stamp)
    np.testing.assert_allclose(poses[stamp], track.motion.position[k], atol=1e-6)
    clouds = rows[f"/{BASE}/turning_link/points"]
    simulation = simulation_of(experiment())
    simulation.reset()
    shown = {row["time"].value: row for row in clouds}
    for cloud in simulation.step(0.25).all["turning"]:
        np.testing.assert_array_equal(shown[cloud.stamp_ns]["Points3D:positions"], cloud.xyz)
        np.testing.assert_array_equal(shown[cloud.stamp_ns]["Points3D:class_ids"], cloud.label)


def test_without_a_viewer_it_says_so() -> None:
    port = free_port()
    with pytest.raises(OutputError, match=rf"^no viewer of rerun listens on port {port} of 127\.0\.0\.1: "):
        RerunSink(port=port)
