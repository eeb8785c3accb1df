# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A live simulation in rerun: what its own server wrote into a file."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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

pytestmark = pytest.mark.usefixtures("small_sky")


def free_port() -> int:
    with socket.socket() as each:
        each.bind(("127.0.0.1", 0))
        return int(each.getsockname()[1])


@contextmanager
def server(file: Path) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """Run rerun's own server, which writes a file, and yield its process and port."""
    port = free_port()
    command = [sys.executable, "-m", "rerun", "--save", str(file), "--bind", "127.0.0.1", "--port", str(port)]
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, start_new_session=True, stdout=quiet, stderr=quiet)
    try:
        wait_for(lambda: socket.socket().connect_ex(("127.0.0.1", port)) == 0, seconds=60)
        yield process, port
    finally:
        end(process)


def wait_until_written(file: Path) -> None:
    """Wait until a server has written what it received: its file did not grow for two seconds."""
    size, since = -1, time.monotonic()
    while time.monotonic() - since < 2.0:
        if (now := file.stat().st_size) != size:
            size, since = now, time.monotonic()
        time.sleep(0.1)


def end(process: subprocess.Popen[bytes]) -> None:
    """End a server, which the library starts as a child of its process."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGTERM)
    process.wait(60)


def test_a_server_hears_world_clouds_and_poses_of_two_beginnings(tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    with server(file := tmp_path / "live.rrd") as (_, port):
        with running(lambda _: RerunSink(port=port), rate=0.0) as (_, run):
            wait_for(lambda: run.simulation.seconds > 0.5, seconds=60)
            run.inbox.take("/fieldtruth/reset", "std_msgs/msg/Int64", SimpleNamespace(data=-1))
            wait_for(lambda: 0.25 < run.simulation.seconds < 0.5, seconds=60)
            wait_for(lambda: run.simulation.seconds > 1.0, seconds=60)  # on a busy machine readings come later
        track = run.simulation.track
        wait_until_written(file)
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


@pytest.mark.slow  # the library waits for the viewer
def test_a_viewer_that_is_closed_ends_nothing(tmp_path: Path) -> None:
    with (
        server(tmp_path / "live.rrd") as (process, port),
        running(lambda _: RerunSink(port=port), rate=0.0) as (_, run),
    ):
        wait_for(lambda: run.simulation.seconds > 0.2, seconds=60)
        end(process)
        reached = run.simulation.seconds
        wait_for(lambda: run.simulation.seconds > reached + 0.5, seconds=60)
        run.inbox.take("/fieldtruth/reset", "std_msgs/msg/Int64", SimpleNamespace(data=-1))
        wait_for(lambda: 0.1 < run.simulation.seconds < reached + 0.5, seconds=60)
        wait_for(lambda: run.simulation.seconds > 0.5, seconds=60)


def test_without_a_viewer_it_says_so() -> None:
    port = free_port()
    with pytest.raises(OutputError, match=rf"^no viewer of rerun listens on port {port} of 127\.0\.0\.1: "):
        RerunSink(port=port)
