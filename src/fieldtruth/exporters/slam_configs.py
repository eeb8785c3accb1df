# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export configuration files of SLAM programs for a run: topics, mounts, lenses, LiDAR and noise of its rig."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.exporters import Options
from fieldtruth.exporters.slam_facts import Facts, read_facts
from fieldtruth.exporters.slam_programs import Files, fast_lio2, kiss_icp, lio_sam, rko_lio
from fieldtruth.exporters.slam_visual import open_vins, orb_slam3
from fieldtruth.exporters.tum import tum_text

PROGRAMS: Final[Mapping[str, Callable[[Facts], Files | str]]] = {
    "KISS-ICP": kiss_icp,
    "RKO-LIO": rko_lio,
    "LIO-SAM": lio_sam,
    "FAST-LIO2": fast_lio2,
    "OpenVINS": open_vins,
    "ORB-SLAM3": orb_slam3,
}

_README: Final = """\
Configuration files of SLAM programs for {run}

{sensors}
{files}"""
_REPUBLISH: Final = """\

OpenVINS and ORB-SLAM3 read raw images; the photographs in the bag are JPEG:
{lines}"""
_ORB_TOPICS: Final = """\
ORB-SLAM3 has names of its own for topics. Beside these, start it with:
  {remaps}
"""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: a file, or a folder, for each program, and a README.txt.

    Programs that cannot read the sensors of the rig are left out, with a warning of one line that says why.

    Raises:
        BagError: the bag has no sensor that any program reads, or no /tf_static, or is damaged.
    """
    (run,) = runs
    with options.progress.stage("write the configuration files"):
        facts = read_facts(run)
        made = {name: program(facts) for name, program in PROGRAMS.items()}
    missing = {name: files for name, files in made.items() if isinstance(files, str)}
    if len(missing) == len(PROGRAMS):
        raise BagError(f"{run.bag} has no sensor that a SLAM program reads: neither LiDAR nor camera")
    files = {path: text for each in made.values() if not isinstance(each, str) for path, text in each.items()}
    for path, text in files.items():
        (target / path).parent.mkdir(parents=True, exist_ok=True)
        (target / path).write_text(text, encoding="utf-8")
    left_out = "; ".join(f"{name}: {why}" for name, why in missing.items())
    if missing:
        warnings.warn(f"left out of {target.name}: {left_out}", FieldtruthWarning, stacklevel=2)
    truths = _write_truths(run, facts, target)
    (target / "README.txt").write_text(_readme(run, facts, made, left_out, truths), encoding="utf-8")


def _write_truths(run: Run, facts: Facts, target: Path) -> str:
    """Write the true poses of the sensors, as far as the bag has poses, and return their line of the README."""
    if not run.has_poses:
        return ""
    mounts = {
        "lidar": facts.lidar and facts.lidar.base_from_lidar,
        "imu": facts.imu and facts.imu.base_from_imu,
        "camera": facts.views[0].base_from_optical if facts.views else None,
    }
    names = []
    for name, base_from_sensor in mounts.items():
        if base_from_sensor is not None:
            names.append(f"truth_{name}.tum")
            (target / names[-1]).write_text(tum_text(run.trajectory, base_from_sensor), encoding="ascii")
    return f"true poses of the sensors in the world, for evo: {', '.join(names)}\n"


def _readme(run: Run, facts: Facts, made: Mapping[str, Files | str], left_out: str, truths: str) -> str:
    used = {
        "LiDAR": facts.lidar and f"{facts.lidar.name}, {facts.lidar.topic}",
        "IMU": facts.imu and f"{facts.imu.name}, {facts.imu.topic}",
        "camera": ", ".join(view.name for view in facts.views),
        "not used": ", ".join(facts.more),
    }
    sensors = "".join(f"{what}: {value}\n" for what, value in used.items() if value)
    files = "".join(f"{name}: {', '.join(each)}\n" for name, each in made.items() if not isinstance(each, str))
    files += (f"left out: {left_out}\n" if left_out else "") + truths
    text = _README.format(run=run.name, sensors=sensors, files=files)
    return text + (_images(facts) if facts.views else "")


def _images(facts: Facts) -> str:
    """How to decompress the photographs, and to give ORB-SLAM3 its topics."""
    topics = [view.topic for view in facts.views]
    lines = "".join(f"  rosrun image_transport republish compressed in:={t} raw out:={t}\n" for t in topics)
    names = ("/camera/left/image_raw", "/camera/right/image_raw") if len(topics) == 2 else ("/camera/image_raw",)
    remaps = [f"{name}:={topic}" for name, topic in zip(names, topics, strict=True)]
    remaps += [f"/imu:={facts.imu.topic}"] if facts.imu else []
    return _REPUBLISH.format(lines=lines) + _ORB_TOPICS.format(remaps=" ".join(remaps))
