# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Run Gazebo 11 headless in the chroot that ``make_chroot.sh`` makes, and read what its sensors measured.

    why = missing_chroot()                       # "" or one line for pytest.skip
    run = run_gazebo(package / "park.world", work / "run", readings=2, limit_s=200)
    assert not run.complaints
    ranges, retro = run.readings("robot__mast__lidar")[-1].values  # model__link__sensor

``run_gazebo`` returns when each sensor has ``readings`` readings, or ``seconds`` of simulated time have passed, or the
caller's ``stop(folder)`` was seen by the recorder plugin; it raises GazeboError when ``limit_s`` of wall time have
passed or Gazebo has crashed. To work beside a running Gazebo (publish commands, stop when a goal is reached) use
``with running_gazebo(...) as process`` and, at the end, ``wait`` and ``results``; ``in_chroot`` makes the command line
of any other program in there. All share this machine's network: Gazebo's address is ``master_uri(folder)``.

GZ_CHROOT is the chroot, GZ_WORK a folder for exported worlds and results; both are below the user's cache by default.
"""

import os
import re
import shutil
import signal
import socket
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import platformdirs
from numpy.typing import NDArray

_CACHE: Final = platformdirs.user_cache_path("fieldtruth")
CHROOT: Final = Path(os.environ.get("GZ_CHROOT", _CACHE / "gazebo_chroot")).absolute()
WORK: Final = Path(os.environ.get("GZ_WORK", _CACHE / "gazebo_work")).absolute()
HERE: Final = Path(__file__).parent
_MAKE: Final = "make_chroot.sh"

_HARMLESS: Final = (
    "ALSA lib",  # no sound card
    "AL lib",
    "Unable to open audio device",
    "Queue limit reached for topic",
    "XDG_RUNTIME_DIR not set",
    "Deleting a connection right after creation",  # the recorder switches sensors off
    "Failed to load resource: /usr/share/gazebo-11/media/audio",
)
"""Parts of lines that any Gazebo prints on a machine without a display and without sound."""
_COMPLAINT: Final = re.compile(
    r"\[Err\]|\[Wrn\]|Error|Warning|terminate called|Segmentation|EXCEPTION|Aborted|ODE (?:INTERNAL|Message)|Assertion"
)

_SERVE: Final = """
Xvfb -displayfd 3 -screen 0 640x480x24 -nolisten tcp 3>"$RECORD_FOLDER/display" 2>"$RECORD_FOLDER/xvfb.log" &
for _ in $(seq 100); do [ -s "$RECORD_FOLDER/display" ] && break; sleep 0.1; done
export DISPLAY=:$(cat "$RECORD_FOLDER/display") HOME="$RECORD_FOLDER/home"
gzserver --verbose --lockstep -s /opt/recorder/build/librecorder.so "$1"
echo "gzserver ends with status $?"
"""


class GazeboError(Exception):
    """Gazebo has crashed or has not finished in time."""


def missing_chroot() -> str:
    """Why Gazebo cannot run here, in one line; empty if it can."""
    if os.geteuid() != 0:
        return "Gazebo runs in a chroot, which needs root"
    if not (CHROOT / "opt/recorder/build/librecorder.so").exists():
        return f"no Gazebo 11 in {CHROOT}: run tests/gazebo/{_MAKE}, or set GZ_CHROOT"
    return ""


def in_chroot(*command: str, folders: Sequence[Path] = ()) -> list[str]:
    """Command line that runs a command in the chroot; the folders are visible there under the same path."""
    binds = [word for folder in folders for word in ("--bind", str(folder.absolute()))]
    return [str(HERE / "in_chroot.sh"), *binds, *command]


def master_uri(folder: Path) -> str:
    """Address of the Gazebo that runs with this results folder: the value of GAZEBO_MASTER_URI."""
    return (folder / "master_uri").read_text()


def stop(folder: Path) -> None:
    """Ask the Gazebo with this results folder to end."""
    (folder / "stop").touch()


class Reading(NamedTuple):
    """A reading: stamp [ns of simulated time] and values.

    Values of a ray sensor: ranges [m], infinite without a hit, and laser_retro of the surface, (2, rows, columns), rows
    from the lowest beam up; of a camera: (rows, columns, 3) RGB. Others have one row, whose columns recorder.cc lists.
    """

    stamp_ns: int
    values: NDArray[Any]


@dataclass(frozen=True, kw_only=True)
class GazeboRun:
    """Results of a run of Gazebo, in its folder.

    ``load_s``: wall seconds from the start to the first step; ``simulated_s`` and ``wall_s`` count from then on;
    ``memory_mb``: largest resident memory of gzserver; ``complaints``: Gazebo's error and warning lines that are not
    harmless.
    """

    folder: Path
    load_s: float
    simulated_s: float
    wall_s: float
    memory_mb: int
    complaints: tuple[str, ...]

    def readings(self, name: str) -> list[Reading]:
        """Readings of a sensor model__link__sensor, or true poses of a model that can move, by name."""
        found = [path for path in self.folder.glob(f"{name}.*") if path.suffix in _BYTES]
        if len(found) != 1:
            raise GazeboError(f"{self.folder} has no readings of {name!r}, only of {sorted(self.names())}")
        return list(_read(found[0]))

    def at_stops(self, name: str) -> list[Reading]:
        """Last reading of a sensor at each stop of the tour."""
        moved = [stop.stamp_ns for stop in _read(self.folder / "tour.stops")]
        last: dict[int, Reading] = {}
        for reading in self.readings(name):
            last[int(np.searchsorted(moved, reading.stamp_ns, side="right")) - 1] = reading
        return [last[k] for k in range(len(moved))]

    def names(self) -> list[str]:
        """Names of all sensors and of all models that can move."""
        return [path.stem for path in self.folder.iterdir() if path.suffix in _BYTES]


_BYTES: Final = {".ray": 16, ".image": 3, ".imu": 8, ".gps": 8, ".pose": 8, ".stops": 8}
"""Bytes for each of rows x columns in a record."""


def _read(path: Path) -> Iterator[Reading]:
    size = _BYTES[path.suffix]
    with path.open("rb") as file:
        while len(header := file.read(16)) == 16:
            stamp = int(np.frombuffer(header, np.int64, 1)[0])
            rows, columns = np.frombuffer(header, np.int32, 2, 8).tolist()
            data = file.read(rows * columns * size)
            if len(data) < rows * columns * size:  # Gazebo was killed while it wrote
                return
            if path.suffix == ".image":
                yield Reading(stamp, np.frombuffer(data, np.uint8).reshape(rows, columns, 3))
            elif path.suffix == ".ray":
                yield Reading(stamp, np.frombuffer(data, np.float64).reshape(2, rows, columns))
            else:
                yield Reading(stamp, np.frombuffer(data, np.float64))


def run_gazebo(
    world: Path, folder: Path, *, limit_s: float, readings: int = 0, seconds: float = 0.0, tour: str = ""
) -> GazeboRun:
    """Run a world file until it has made its readings or its seconds; the limits are explained in the module.

    ``tour`` is the text of tour.txt, see recorder.cc.
    """
    folder.mkdir(parents=True)
    if tour:
        (folder / "tour.txt").write_text(tour)
    with running_gazebo(world, folder, readings=readings, seconds=seconds) as process:
        wait(process, folder, limit_s)
    return results(folder)


@contextmanager
def running_gazebo(
    world: Path,
    folder: Path,
    *,
    readings: int = 0,
    seconds: float = 0.0,
    folders: Sequence[Path] = (),
    environment: Mapping[str, str] = {},
) -> Iterator[subprocess.Popen[bytes]]:
    """A Gazebo that runs beside the caller's code and is killed, with all it has started, at the end.

    Models are looked up in ``models`` beside the folder ``worlds`` of an exported world. ``folder``, for the results,
    must be new or hold tour.txt only. ``folders`` are others that Gazebo must see; ``environment`` is added to its own.
    """
    world, folder = world.absolute(), folder.absolute()
    (folder / "home").mkdir(parents=True)
    package = world.parent.parent if world.parent.name == "worlds" else world.parent
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        uri = f"http://127.0.0.1:{free.getsockname()[1]}"
    (folder / "master_uri").write_text(uri)
    paths = f"{package}:{package / 'models'}"
    settings = {
        "RECORD_FOLDER": str(folder),
        "RECORD_COUNT": str(readings),
        "RECORD_SECONDS": str(seconds),
        "GAZEBO_MASTER_URI": uri,
        "GAZEBO_IP": "127.0.0.1",
        "GAZEBO_MODEL_DATABASE_URI": "",  # never asks the network
        "GAZEBO_MODEL_PATH": f"{paths}:/usr/share/gazebo-11/models",
        "GAZEBO_RESOURCE_PATH": f"{paths}:/usr/share/gazebo-11",
        "GAZEBO_PLUGIN_PATH": "/usr/lib/x86_64-linux-gnu/gazebo-11/plugins",
        "OGRE_RESOURCE_PATH": "/usr/lib/x86_64-linux-gnu/OGRE-1.9.0",
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "GALLIUM_DRIVER": "softpipe",  # cameras without anti-aliasing
        **environment,
    }
    pairs = [f"{name}={value}" for name, value in settings.items()]
    command = in_chroot("env", *pairs, "bash", "-c", _SERVE, "gazebo", str(world), folders=[package, folder, *folders])
    with (folder / "gazebo.log").open("wb") as log:
        process = subprocess.Popen(
            command, env={**os.environ, "GZ_CHROOT": str(CHROOT)}, stdout=log, stderr=log, start_new_session=True
        )
        try:
            yield process
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)  # the namespace's processes end with it
            process.wait()
            shutil.rmtree(folder / "home", ignore_errors=True)


def wait(process: subprocess.Popen[bytes], folder: Path, limit_s: float) -> None:
    """Wait until Gazebo has ended by itself; raise GazeboError if it crashed or takes longer than ``limit_s``."""
    try:
        process.wait(limit_s)
    except subprocess.TimeoutExpired:
        raise GazeboError(f"Gazebo has not finished in {limit_s} s; its output is {folder / 'gazebo.log'}") from None
    if not (folder / "summary.txt").exists():
        raise GazeboError(f"Gazebo has crashed; its output is {folder / 'gazebo.log'}")


def results(folder: Path) -> GazeboRun:
    """Read the results of a run from its folder."""
    load_s = (folder / "started").stat().st_mtime - (folder / "master_uri").stat().st_mtime
    simulated, wall, memory = (float(word) for word in (folder / "summary.txt").read_text().split())
    return GazeboRun(
        folder=folder,
        load_s=load_s,
        simulated_s=simulated,
        wall_s=wall,
        memory_mb=round(memory),
        complaints=complaints((folder / "gazebo.log").read_text(errors="replace")),
    )


def complaints(log: str) -> tuple[str, ...]:
    """Distinct error and warning lines of Gazebo's output, without those that are harmless."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", log)
    lines = [line.strip() for line in plain.splitlines() if _COMPLAINT.search(line)]
    return tuple(dict.fromkeys(line for line in lines if not any(part in line for part in _HARMLESS)))
