# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Same experiment, same bytes, with real worlds, drives and sensors: for any number of workers, and after a kill."""

import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from small_park import in_small_park

from fieldtruth.core.cache import cache_folder
from fieldtruth.core.cache_folder import entries
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, load_experiment
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.pipeline import generate
from fieldtruth.render import daylight
from fieldtruth.render.bake import light_key
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.world.build import world_key, world_of

SKY_TEXELS = 512
RUN = (
    f"import sys; from fieldtruth.cli import main; from fieldtruth.render import daylight;"
    f"daylight.DOME_TEXELS = {SKY_TEXELS}; sys.exit(main(sys.argv[1:]))"
)

pytestmark = pytest.mark.slow  # real worlds; tests/record/test_pipeline.py shows the same with quick ones


@pytest.fixture(scope="module", autouse=True)
def _small_skies() -> Iterator[None]:
    """Skies of 512 x 512 texels, as in ``RUN``: one of the full size takes many seconds for a park of 24 m."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(daylight, "DOME_TEXELS", SKY_TEXELS)
        yield


def small(seed: int = 0, *, cameras: bool = True) -> Experiment:
    """A drive through the small park with small images."""
    rig = paper_rig(cameras=StereoConfig(width=160, height=88, enabled=cameras))
    return in_small_park(seconds=1.2, seed=seed, rig=rig)


SMALL = small()


def written(folder: Path) -> Path:
    """File of the experiment, for the command line."""
    path = folder / "small.yaml"
    path.write_text(dump_experiment(SMALL))
    return path


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> str:
    return digest(generate(SMALL, tmp_path_factory.mktemp("once"), workers=1))


def test_two_workers_and_the_written_experiment_give_the_same_bytes(once: str, tmp_path: Path) -> None:
    bag = generate(SMALL, tmp_path / "first", workers=2)
    assert digest(bag) == once
    again = load_experiment(str(bag.parent / "experiment.yaml"))
    assert digest(generate(again, tmp_path / "second", workers=2)) == once


def test_a_killed_run_resumes_and_ends_with_the_same_bytes(once: str, tmp_path: Path) -> None:
    source = written(tmp_path)
    out = tmp_path / "data"
    command = [sys.executable, "-c", RUN, "generate", str(source), "--out", str(out), "--workers", "1"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 300
    slices = out / "small" / ".slices"
    while not any(path.stat().st_size for path in slices.rglob("*.journal")):  # the first slice is joined
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not (out / "small" / "small.bag").exists()
    assert digest(generate(load_experiment(str(source)), out, workers=2)) == once


def copied_cache(folder: Path) -> list[Path]:
    """Copy the small park's world, its light and all kernels to another cache folder; returns the files."""
    world = world_of(SMALL)  # another version may have removed it
    worlds = list(cache_folder().glob(f"park-0_*-{world_key('park')}.npz"))
    light = cache_folder() / f"light-park-{light_key(Scene(world), SMALL.light, SMALL.weather)}.npz"
    kernels = [entry.path for entry in entries(cache_folder()) if entry.path.is_dir()]
    for path in (*worlds, light, *kernels):
        target = folder / path.relative_to(cache_folder())
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(path, target) if path.is_dir() else shutil.copy(path, target)
    return sorted(path for path in folder.rglob("*") if path.is_file())


def test_a_damaged_cache_is_made_again_and_never_changes_the_data(once: str, tmp_path: Path) -> None:
    files = copied_cache(tmp_path / "cache" / "fieldtruth")
    kernels = [path for path in files if path.suffix == ".kernel"]
    bits = random.Random(3)
    quick = sorted(kernels, key=lambda path: path.stat().st_size)[: len(kernels) // 2]  # to compile again
    damaged = [path for path in files if path.suffix == ".npz"] + bits.sample(quick, 12)
    for path in damaged:
        with path.open("r+b") as file:
            at = bits.randrange(path.stat().st_size)
            file.seek(at)
            byte = file.read(1)[0]
            file.seek(at)
            file.write(bytes([byte ^ 1 << bits.randrange(8)]))
    source = written(tmp_path)
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", RUN, "generate", str(source), "--out", str(tmp_path / "data")]
    subprocess.run(command, check=True, env=environment)
    assert digest(tmp_path / "data" / "small" / "small.bag") == once


def test_another_seed_is_another_world(tmp_path: Path) -> None:
    """Clouds show it: images would need the light of the other world."""
    bags = [generate(small(seed, cameras=False), tmp_path / name) for name, seed in (("a", 0), ("b", 0), ("c", 1))]
    digests = [digest(bag) for bag in bags]
    assert digests[0] == digests[1] != digests[2]
