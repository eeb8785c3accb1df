# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The first run: the largest kernels compile in a process of their own while world, drive and light are made.

Numba compiles on one thread of a process. So a second process reads each sensor that sees once, in a world that is a
box, in the same light and weather, and keeps the code in the cache. If this process needs a kernel meanwhile, it waits
for the file of one that is being compiled, and compiles any other itself (``kernels.compile``): nothing depends on the
second process. It is not started where no file can be kept, or where only one core is free. It ends with this one,
however this one ends: its standard input is a pipe, which the system then closes.
"""

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

import fieldtruth
from fieldtruth.core.arrays import Array
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, parse_experiment
from fieldtruth.experiment.imaging_config import ImagingConfig
from fieldtruth.kernels.baking import gather_probes
from fieldtruth.kernels.compile import can_save, is_saved
from fieldtruth.kernels.photograph import render_linear
from fieldtruth.render.bake import BakedScene, lit_scene
from fieldtruth.sensors.kind import At, Movement, SensorWorld
from fieldtruth.sensors.known import sensor_class
from fieldtruth.world.model import MeshPart, World

_PATIENCE_S: Final = 900.0
_TEXELS: Final = 512
"""Of the dome along each side: few, as it is not looked at."""
_SPEEDS: Final = (0.0, 1.0)
"""[m/s] at which sensors read: a camera that moves may need other kernels than one that stands."""
_CORNERS: Final = np.array([(x, y, z) for x in (3.0, 4.0) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
_SIDES: Final = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
_processes: Final[list[subprocess.Popen[bytes]]] = []


_LARGE: Final[tuple[Callable[..., Any], ...]] = (gather_probes, render_linear)
"""Kernels that take longest to compile."""


def lacks_kernels(experiment: Experiment) -> bool:
    """Return whether the largest kernels that an experiment needs were never compiled."""
    return bool(experiment.rig.imagers) and not all(map(is_saved, _LARGE))


def compile_beside(experiment: Experiment) -> None:
    """Begin to compile in a second process, unless it has begun, all is compiled, or it would be of no use."""
    if not lacks_kernels(experiment) or not all(map(can_save, _LARGE)):
        return
    if _running() is not None or cpu_count() == 1 or not sys.executable:
        return
    text = dump_experiment(experiment).encode()
    paths = [str(Path(fieldtruth.__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])]
    with suppress(OSError):
        process = subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
        _processes[:] = [process]
        threading.Thread(target=process.wait, daemon=True).start()  # so that the system can forget it when it ends
        assert process.stdin is not None
        process.stdin.write(b"%d\n%s" % (len(text), text))
        process.stdin.flush()


def wait_for_kernels(progress: Progress) -> None:
    """Wait until the second process has ended, if there is one."""
    if (process := _running()) is not None:
        with progress.stage("compile (first run only)"), suppress(subprocess.TimeoutExpired):
            process.wait(_PATIENCE_S)


def _running() -> "subprocess.Popen[bytes] | None":
    """Return the second process, if it has not ended."""
    return next((process for process in _processes if process.poll() is None), None)


class _Box(SensorWorld):
    """A world that is a box, whose light is not kept."""

    @property
    def baked(self) -> BakedScene:
        """The scene with its light; baked at the first use."""
        return self.once("baked", lambda: lit_scene(self.scene, self.light, self.weather, 1, texels=_TEXELS))


def compile_kernels(experiment: Experiment) -> None:
    """Compile the kernels of the sensors that see: read each of them, cameras first, whose kernels are the largest."""
    rig = experiment.rig
    world = World.from_meshes(
        [MeshPart((_CORNERS, np.vstack([_SIDES[:, :3], _SIDES[:, [0, 2, 3]]])), "bench")], ground=0.0
    )
    sensor_world = _Box(world, rig, experiment.light, experiment.weather, seed=experiment.seed)
    seeing = (config for config in rig.in_order() if config.sees)
    for config in sorted(seeing, key=lambda config: not isinstance(config, ImagingConfig)):
        sensor = sensor_class(config)(config, sensor_world)
        for output in config.outputs_on(rig.robot):
            for speed in _SPEEDS if config.signal is not None else _SPEEDS[:1]:
                sensor.read(output, At(0, 0, 0, _moving(speed), 100_000_000))


def _moving(speed: float) -> Movement:
    """Return the motion of a robot that drives straight on, at a speed [m/s]."""

    def pose(stamp_ns: int | NDArray[np.int64]) -> Array:
        poses = np.tile(np.eye(4), (*np.shape(stamp_ns), 1, 1))
        poses[..., 0, 3] = speed * 1e-9 * np.asarray(stamp_ns)
        return poses

    return Movement(pose)


def _end_with_parent() -> None:
    """End this process when its standard input is closed."""
    with suppress(OSError):
        while os.read(0, 1):
            pass
    os._exit(0)


def main() -> None:
    """Read an experiment, preceded by its length in bytes, and compile what it needs."""
    text = sys.stdin.buffer.read(int(sys.stdin.buffer.readline())).decode()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    compile_kernels(parse_experiment(text))
    os._exit(0)


if __name__ == "__main__":
    main()
