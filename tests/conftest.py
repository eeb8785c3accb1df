# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shared fixtures: made once, and not changed by tests."""

import gc
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import pytest
from filelock import FileLock
from kept_worlds import KEPT, SKY_TEXELS, Kept
from many_sensors import many_rig
from numpy.random import Generator
from small_park import in_small_park

from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.arrays import Float32Array
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.experiment.light_config import Light
from fieldtruth.exporters import FORMATS, export
from fieldtruth.pipeline import generate
from fieldtruth.render import daylight
from fieldtruth.render.daylight import Daylight
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.world import library
from fieldtruth.world.model import World

if TYPE_CHECKING:
    from browser_tab import Tab
    from report_pages import Page

# Workers inherit it, and the commands that tests start. Products of matrices with threads for all cores in each of them
# spend most of their processor time waiting for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

_LEAN_NS: Final = 520_000_000
_LONG: Final = ("test_annotate.py", "test_crowns.py", "test_eight_drives.py")
"""Files that take long although they have many tests: last, one of them would keep one worker while the other waits."""
Once = Callable[[str, Callable[[Path], object]], Path]


@pytest.hookimpl(hookwrapper=True)
def pytest_collection() -> Iterator[None]:
    """Search no garbage while modules are imported, and later not among what stays: a sixth of the time."""
    gc.disable()
    yield
    gc.freeze()
    gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files in an order in which two workers build little twice and end together.

    Each worker begins with a half of the list, and takes from the end of the other's when it has none left. The run in
    the park, its world and its light are for the first half. Files of few tests have the long ones and come before
    those of many.
    """
    tests = Counter(item.path for item in items)
    of_run = {item.path for item in items if "small_run" in getattr(item, "fixturenames", ())}
    items.sort(key=lambda item: (item.path not in of_run, item.path.name not in _LONG, tests[item.path]))


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Once:
    """Folder of a name, filled by the first worker that asks for it; all of them use it."""
    base = tmp_path_factory.getbasetemp()
    shared = base if worker_id == "master" else base.parent

    def filled(name: str, fill: Callable[[Path], object]) -> Path:
        folder, full = shared / f"once_{name}", shared / f"once_{name}.full"
        with FileLock(shared / f"once_{name}.lock"):
            if not full.exists():
                folder.mkdir(exist_ok=True)
                fill(folder)
                full.touch()
        return folder

    return filled


@pytest.fixture(scope="module", autouse=True)
def _folders_of_module(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Remove the folders that a file's fixtures made after its last test, if none failed: pytest keeps them all."""
    base, failed = tmp_path_factory.getbasetemp(), request.session.testsfailed
    before = set(base.iterdir())
    yield
    if request.session.testsfailed == failed:
        for made in set(base.iterdir()) - before:
            if not made.name.startswith("once_"):
                shutil.rmtree(made, ignore_errors=True)


def _small_experiment(width: int = 160) -> Experiment:
    values = load_experiment("park_1").model_dump()
    values["seconds"] = 1.2
    values["rig"]["cameras"] = {"width": width, "height": 23 * width // 40, "depth": True, "instances": True}
    return Experiment.model_validate(values)


def _small_run(once: Once, request: pytest.FixtureRequest, width: int) -> Path:
    def fill(folder: Path) -> None:
        request.getfixturevalue("park")
        with _worlds_of(KEPT):
            generate(_small_experiment(width), folder)

    return once(f"small_run_{width}", fill) / "park_1"


@pytest.fixture(scope="session")
def small_run(once: Once, request: pytest.FixtureRequest) -> Path:
    """Folder of 1.2 s of park_1 with depth and instances, images of 160 x 92. Copy what you want to change."""
    return _small_run(once, request, 160)


@pytest.fixture(scope="session")
def fine_run(once: Once, request: pytest.FixtureRequest) -> Path:
    """The small run with images of 320 x 184, to which LiDARs are compared. Copy what you want to change."""
    return _small_run(once, request, 320)


@pytest.fixture(scope="session")
def flat_world() -> World:
    """Level ground without objects."""
    from drive_worlds import make_world

    return make_world()


@pytest.fixture(scope="session")
def small_ground_images() -> Iterator[None]:
    """Scenes for other tools with small images of the ground, because each of the full size takes a second."""
    from fieldtruth.interchange import ground

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ground, "GROUND_PIXELS", 128)
        yield


@pytest.fixture(scope="session")
def winding_track() -> Track:
    """A drive with turns to both sides over rolling ground."""
    from drive_worlds import hills, make_experiment, make_world

    from fieldtruth.drive.simulate import drive

    route = make_experiment([(5.0, 2.0), (9.0, -3.0), (5.0, -7.0), (0.0, -4.0)], start=(0.0, 0.0))
    return drive(make_world(hills), route)


@pytest.fixture(scope="session")
def lean_run(fine_run: Path, once: Once) -> Path:
    """Folder of the first 0.52 s of the fine run, as a run of its own. Copy what you want to change."""

    from changed_bags import rewritten

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        return raw if raw.stamp_ns <= _LEAN_NS else None

    shorter = with_overrides(load_experiment(fine_run / "experiment.yaml"), seconds=_LEAN_NS / 1e9)
    return once("lean_run", lambda folder: rewritten(fine_run, folder, change, shorter)) / "park_1"


@pytest.fixture(scope="session")
def kept() -> Kept:
    """Worlds, scenes, light and second tracers, each made once."""
    return KEPT


@pytest.fixture(scope="session")
def park(kept: Kept) -> SensorWorld:
    """World, scene and light of park_1."""
    made = _small_experiment()
    world = kept.world_of(made)
    lit = kept.bake(kept.scene(world), made.light, made.weather)
    return SensorWorld(world, made.rig, made.light, made.weather, baked=lit, seed=made.seed)


@contextmanager
def _worlds_of(kept: Kept) -> Iterator[None]:
    """Runs use worlds, scenes, light and tracers that were made before."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fieldtruth.annotation.load_world", kept.load_world)
        patch.setattr("fieldtruth.validation.rays.ReferenceTracer", kept.tracer)
        patch.setattr("fieldtruth.world_maps.layers.faces_of", kept.faces_of)
        for module in ("simulation.stepped", "validation.world", "local_maps", "report.page.map"):
            patch.setattr(f"fieldtruth.{module}.world_of", kept.world_of)
        for module in ("sensors.kind", "validation.world", "report.page.map", "report.preview"):
            patch.setattr(f"fieldtruth.{module}.Scene", kept.scene)
        for module in ("sensors.kind", "report.page.map", "report.preview"):
            patch.setattr(f"fieldtruth.{module}.bake", kept.bake)
        yield


@pytest.fixture(scope="module")
def in_park(kept: Kept) -> Iterator[None]:
    """Runs in the full park, in the small one and in others use what was made before."""
    with _worlds_of(kept):
        yield


# ---------------------------------------------------------------------------------------------------------------------
# For the tests of report


@pytest.fixture(scope="session")
def page(small_run: Path, once: Once, kept: Kept) -> "Page":
    """HTML page of the small run, whose aerial view is in the coarse light that the run has."""
    from report_pages import Page, write_page

    def fill(folder: Path) -> None:
        with _worlds_of(kept):
            write_page(small_run, folder / "page.html")

    return Page(once("page", fill) / "page.html")


@pytest.fixture(scope="session")
def many_run(once: Once, kept: Kept) -> Path:
    """Folder of 0.42 s in the small park with the rig of ``many_sensors``. Copy what you want to change."""

    def fill(folder: Path) -> None:
        with _worlds_of(kept):
            generate(in_small_park(name="many", seconds=0.42, rig=many_rig()), folder)

    return once("many_run", fill) / "many"


@pytest.fixture(scope="session")
def messages(small_run: Path) -> dict[str, list[Any]]:
    """Messages of some topics of the small run, as the rosbags library reads them."""
    from report_pages import read_messages

    return read_messages(small_run / "park_1.bag")


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Headless browser; tests are skipped if none is installed."""
    from browser_tab import opened_browser

    with opened_browser() as opened:
        yield opened


@pytest.fixture
def tab(browser: Any, page: "Page") -> Iterator["Tab"]:
    """The page of the small run in the browser."""
    from browser_tab import Tab

    opened = Tab(browser, page.path)
    yield opened
    opened.close()


# ---------------------------------------------------------------------------------------------------------------------
# For the tests of exporters


@pytest.fixture(scope="session")
def bag(small_run: Path) -> Path:
    """Bag of the small run."""
    return small_run / "park_1.bag"


@pytest.fixture(scope="session")
def short(small_run: Path, once: Once) -> Path:
    """Bag with the first six images of each camera."""
    from export_bags import copied

    def begin(topic: str, stamp: int, data: bytes) -> bytes | None:
        return data if stamp <= 240_000_000 else None

    return once("short", lambda folder: copied(small_run / "park_1.bag", folder / "a.bag", begin)) / "a.bag"


@pytest.fixture(scope="session")
def brief_run(small_run: Path, once: Once) -> Path:
    """Folder of the first 0.44 s of the small run, as a run of its own: eleven stereo pairs, two with a cloud."""
    from export_bags import copied

    def fill(folder: Path) -> None:
        bag = folder / "park_1/park_1.bag"
        copied(small_run / "park_1.bag", bag, lambda _, stamp, data: data if stamp <= 440_000_000 else None)
        shutil.copy(small_run / "experiment.yaml", bag.parent)

    return once("brief_run", fill) / "park_1"


@pytest.fixture(scope="session")
def faked_many_run(once: Once) -> Path:
    """Folder of 0.6 s with two LiDARs, five cameras, two IMUs and two antennas, whose images and clouds are fakes."""
    from many_recording import record_many

    return once("faked_many_run", record_many) / "many"


@pytest.fixture(scope="session")
def exported(small_run: Path, once: Once) -> Callable[[str], Path]:
    """Export of the small run in a format, made once with two workers."""

    def export_once(to: str) -> Path:
        name = f"park_1{FORMATS[to].suffix}"
        return once(f"as_{to}", lambda folder: export(small_run, to, out=folder / name, workers=2)) / name

    return export_once


_SIDE: Final = 64.0  # [m], of small worlds
_DAYS: Final = dict[Any, Daylight]()
_HEAPS: Final = dict[Any, Any]()


@pytest.fixture(scope="module", autouse=True)
def _of_folder(request: pytest.FixtureRequest) -> None:
    """Small skies for the folders whose tests are in small worlds; files elsewhere ask for ``small_sky``.

    Tests of worlds add files of species and environments.
    """
    if request.path.parent.name in ("render", "simulation"):
        request.getfixturevalue("small_sky")
    if request.path.parent.name == "world":
        request.getfixturevalue("package_files_are_read_once")


@pytest.fixture(scope="session")
def package_files_are_read_once() -> Iterator[None]:
    """The package's own files, which do not change, stay in memory when a test adds another: to parse them is slow."""
    real = library._document
    of_package = cache(real.__wrapped__)

    def document(path: Path) -> Any:
        return of_package(path) if library.FOLDER in path.parents else real(path)

    document.cache_clear = real.cache_clear  # type: ignore[attr-defined]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(library, "_document", document)
        yield


@pytest.fixture(scope="module")
def untextured() -> Iterator[None]:
    """Worlds are built without textures, which change neither layout nor labels."""
    from sense_worlds import without_textures

    with without_textures():
        yield


@pytest.fixture(scope="module")
def small_sky() -> Iterator[None]:
    """Skies of 512 x 512 texels in small worlds, each made once: one of the full size takes seconds.

    Small worlds of any size have the same, and skies that differ in the sun alone have the same heaps of clouds.
    """
    make = daylight.cumulus_map

    def heaps(rng: Generator, cover: float, thickness: float) -> Float32Array:
        key = str(rng.bit_generator.state), cover, thickness
        if key not in _HEAPS:
            _HEAPS[key] = make(rng, cover, thickness), rng.bit_generator.state
        amount, rng.bit_generator.state = _HEAPS[key]
        return cast(Float32Array, amount)

    def day_of(
        light: Light, size: tuple[float, float], rng: Generator, pool: ThreadPoolExecutor, texels: int
    ) -> Daylight:
        size = (_SIDE, _SIDE) if max(size) <= _SIDE else size
        key = light, size, str(rng.bit_generator.state), texels
        if key not in _DAYS:
            _DAYS[key] = daylight.metered_daylight(light, size, rng, pool, texels)
        return _DAYS[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(daylight, "DOME_TEXELS", SKY_TEXELS)
        patch.setattr(daylight, "cumulus_map", heaps)
        patch.setattr("fieldtruth.render.light.metered_daylight", day_of)
        yield
