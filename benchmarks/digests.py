# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bytes of what the package makes: SHA-256 of bags, data cards and exports, to compare two versions on one machine.

Of a bag the messages in their order are compared, with topics, types and stamps: the chunks that hold them may change.

Run: python benchmarks/digests.py FOLDER [--only park_1 exports] [--against OLD.json]. Prints JSON, and with --against
exits with 1 if a digest differs. Bytes depend on the processor (see README), so both files must be of one machine.
``benchmarks/digests.json`` has those of the version that made its worlds of files of layers, on an EPYC with AVX-512.
"""

import argparse
import hashlib
import json
import os
import shutil
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import fieldtruth as ft
from fieldtruth.bag.file import CARD, EXPERIMENT
from fieldtruth.bag.reader import open_bag
from fieldtruth.experiment.names import campaign_experiments
from fieldtruth.exporters import FORMATS

SECONDS = 1.0
_SIZE = {"width": 160, "height": 96, "rate_hz": 5.0}
MANY: list[dict[str, Any]] = [
    {"kind": "lidar", "name": "top", "columns": 256, "rings": 16, "mount": {"xyz": [0.0, 0.0, 0.9]}},
    {
        "kind": "lidar",
        "name": "low",
        "model": "vlp_16",
        "mount": {"xyz": [0.55, 0.0, 0.2], "rpy_deg": [0.0, 15.0, 0.0]},
    },
    {"kind": "lidar", "name": "livox", "model": "mid_360", "mount": {"xyz": [0.0, 0.0, 1.0]}},
    {"kind": "stereo", "name": "pair", "baseline": 0.1, "depth": True, "mount": {"xyz": [0.3, 0.0, 0.6]}, **_SIZE},
    {
        "kind": "camera",
        "name": "front",
        **dict.fromkeys(("depth", "instances", "normals", "flow"), True),
        "mount": {"xyz": [0.4, 0.0, 0.7]},
        **_SIZE,
    },
    {"kind": "camera", "name": "fisheye", "model": "fisheye_190", "mount": {"xyz": [0.5, 0.0, 0.4]}, **_SIZE},
    {"kind": "camera", "name": "sphere", "lens": {"model": "equirectangular"}, "mount": {"xyz": [0, 0, 1.1]}, **_SIZE},
    {"kind": "imu", "name": "imu_front", "rate_hz": 200.0, "mount": {"xyz": [0.2, 0.0, 0.1]}},
    {"kind": "imu", "name": "imu_rear", "sampling": "instant", "mount": {"xyz": [-0.2, 0.1, 0.1]}},
    {"kind": "gnss", "name": "antenna", "rate_hz": 5.0, "mount": {"xyz": [0.0, 0.25, 0.9]}},
    {"kind": "wheel_odometry", "rate_hz": 20.0},
]


def main() -> None:
    """Make what is asked for in a folder, and print the digests."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=[], help="names of the parts, by default all")
    parser.add_argument("--against", type=Path)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    against = arguments.against.read_text() if arguments.against else ""
    os.chdir(arguments.folder)  # relative paths, as some exports name their source
    found: dict[str, str] = {}
    for name, make in parts().items():
        if not arguments.only or name in arguments.only:
            found |= make()
    print(json.dumps(found, indent=1))
    if arguments.against:
        old = json.loads(against)
        changed = [name for name, digest in found.items() if old.get(name) != digest]
        print(f"{len(found) - len(changed)} equal, changed: {', '.join(changed) or 'none'}", file=sys.stderr)
        sys.exit(bool(changed))


def parts() -> dict[str, Callable[[], dict[str, str]]]:
    """Each part's name and what makes it."""
    made: dict[str, Callable[[], dict[str, str]]] = {
        name: partial(run, name, ft.load_experiment(name)) for name in campaign_experiments(every=False)
    }
    park = ft.load_experiment("park_1")
    made["datasheet"] = lambda: run("datasheet", ft.with_overrides(park, signal="datasheet"))
    many = park.model_copy(update={"rig": ft.Rig.model_validate({"sensors": MANY}), "name": "many"})
    made["many"] = lambda: run("many", many)
    made["exports"] = exports
    return made


def run(name: str, experiment: ft.Experiment) -> dict[str, str]:
    """Generate a second of an experiment; digests of its bag and data card."""
    bag = ft.generate(experiment.model_copy(update={"seconds": SECONDS}), name, overwrite=True)
    return {f"{name}/{path.name}": digest(path) for path in (bag, bag.with_name(EXPERIMENT), bag.with_name(CARD))}


def exports() -> dict[str, str]:
    """Every export of a second of park_1 with all images."""
    park = ft.load_experiment("park_1")
    rig = park.rig.with_sensors(
        ft.StereoConfig, width=320, height=184, depth=True, instances=True, normals=True, flow=True
    )
    bag = ft.generate(park.model_copy(update={"seconds": SECONDS, "rig": rig}), "source", overwrite=True)
    out = Path("exports")
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    found = {"exports/bag": digest(bag)}
    for name in FORMATS:
        target = ft.export(bag, name, out=out / name)
        found[f"exports/{name}"] = digest(target)
    return found


def digest(path: Path) -> str:
    """SHA-256 of a bag's messages, of a file, or of names and contents of all files in a folder."""
    total = hashlib.sha256()
    if path.suffix == ".bag":
        with open_bag(path, own_names=True) as bag:
            for each in bag.connections:
                total.update(repr((each.topic, each.msgtype, each.msgdef, each.digest, each.ext)).encode())
            for message in bag.messages():
                total.update(f"{message.stamp_ns} {message.topic} {len(message.data)}\n".encode() + message.data)
        return total.hexdigest()
    for file in [path] if path.is_file() else sorted(each for each in path.rglob("*") if each.is_file()):
        total.update(str(file.relative_to(path)).encode() + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()


if __name__ == "__main__":
    main()
