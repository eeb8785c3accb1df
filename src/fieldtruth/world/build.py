# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds by name and seed, built by rules or read from the cache, and the file in which a world is stored."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass, replace
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from inspect import signature
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np

from fieldtruth.core.cache import cache_folder as default_cache_folder
from fieldtruth.core.cache import cache_key, file_digests
from fieldtruth.core.cache_folder import load_or_make
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.files import atomic_output
from fieldtruth.core.geodesy import Origin
from fieldtruth.core.parallel import check_memory
from fieldtruth.core.progress import Progress
from fieldtruth.experiment.environment_file import files_of, is_environment_file, resolved
from fieldtruth.experiment.fields import Frozen, validated_as
from fieldtruth.world.assembly import cut_at_edge
from fieldtruth.world.environments import find_environment
from fieldtruth.world.environments.layout import PLANTINGS, GroundConfig
from fieldtruth.world.grids import Line
from fieldtruth.world.library import data_files
from fieldtruth.world.model import Collider, Heightfield, Instance, Material, Mesh, Raster, Swarm, Terrain, World
from fieldtruth.world.objects.files import with_named
from fieldtruth.world.seasons.change import in_season

_STORED: Final = {
    each.__name__: each for each in (Collider, Heightfield, Instance, Material, Mesh, Raster, Swarm, Terrain, World)
}
_ALIGNED: Final = 64  # [byte] multiples at which arrays start in a stored world
_LIBRARIES: Final = ("numpy", "scipy", "numba")
_EXTRAS: Final = {
    "maps": ("laspy", "osmium", "pyogrio", "pyproj", "rasterio", "shapely"),
    "objects": ("trimesh",),
    "usd": ("pxr",),
}
"""Libraries by the extra that installs them."""
_READERS: Final = (*_EXTRAS["maps"], "lazrs", "trimesh", "usd-core", "pillow")
"""Distributions that read the files of a layout, if they are installed."""
_BASE: Final = 4e8
"""Memory [byte] for building a world, besides what grows with its terrain's nodes and with its area."""
_PER_NODE: Final = 60
"""Memory [byte] per node of the terrain while it is built."""
_PER_M2: Final = 1000
"""Memory [byte] for the objects on a square metre."""


def build_world(
    environment: str, seed: int = 0, layout: Mapping[str, Any] | None = None, *, progress: Progress | None = None
) -> World:
    """Build an environment. The same name, seed and layout give the same world.

    ``layout`` changes its configuration, for example ``{"old_trees": 60}``; docs/environments.md lists the keys. The
    corridors of the environment stay free of obstacles in every layout. ``{"beyond": False}`` ends the world at its
    edge; what is inside stays the same. ``progress`` receives the stages of a site's world.

    Raises:
        UnknownNameError: unknown environment.
        ConfigurationError: a key or value that the layout does not allow, or a file that cannot be used.
        CrowdedWorldError: the layout has more objects than fit into the world.
        OutputError: its terrain needs more memory than there is.
    """
    check_layout(environment, layout)
    environment, layout = resolved(environment, layout)
    config: Any = layout_model(environment).model_validate(layout)
    if isinstance(config, GroundConfig):  # environments of other packages may have another layout
        (length, width), spacing = config.size, config.spacing
        task = f"a world of {length:g} m x {width:g} m with nodes every {spacing:g} m"
        needed = _BASE + length * width * (_PER_NODE / spacing**2 + _PER_M2)
        check_memory(int(needed), task, "make layout.grid larger, or layout.size smaller")
        config = config.for_size()
    with needed_libraries():
        build = _module(environment, "build").build
        shown = {"progress": progress} if "progress" in signature(build).parameters else {}
        world: World = build(seed, reserved_corridors(environment), config, **shown)
    if isinstance(config, GroundConfig):
        world = in_season(world, config.season, config.drought, config.snow_depth)
    world = replace(world, layout=layout)
    return cut_at_edge(world) if getattr(config, "beyond", True) is False else world


@contextmanager
def needed_libraries() -> Iterator[None]:
    """Raise ConfigurationError that names the extra of a library which is not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        extra = next((extra for extra, names in _EXTRAS.items() if library in names), None)
        if extra is None:
            raise
        text = f"the library {library} is not installed; run: pip install 'fieldtruth[{extra}]'"
        raise ConfigurationError(text) from error


class WorldChoice(Protocol):
    """The part of an experiment that shapes its world: `Experiment` itself would add all sensors to `world_key`."""

    @property
    def environment(self) -> str:
        """Name of the environment."""

    @property
    def seed(self) -> int:
        """Seed of everything random."""

    @property
    def layout(self) -> Mapping[str, Any]:
        """Changes to the environment's configuration."""


def check_experiment(experiment: WorldChoice, source: str = "") -> None:
    """Check that an experiment's environment exists and that its layout is allowed there.

    Raises:
        UnknownNameError: unknown environment; the text starts with ``source``, a file's name for example.
        ConfigurationError: a key or value that the environment's layout does not allow; the text starts likewise.
    """
    check_layout(experiment.environment, experiment.layout, source)


def check_layout(environment: str, layout: Mapping[str, Any] | None, source: str = "") -> None:
    """Check an environment's name and a layout for it; raises as ``check_experiment``."""
    if is_environment_file(environment):
        _check(*resolved(environment), environment)
    name, whole = resolved(environment, layout)
    find_environment(name, source)
    _check(name, whole, f"{source}: layout" if source else "layout")


def _check(environment: str, layout: Mapping[str, Any], where: str) -> None:
    validated_as(layout_model(environment), layout, where)
    for key, path in files_of(layout):
        if not path.is_file():
            raise ConfigurationError(f"{where}: {key}: {'a folder' if path.is_dir() else 'no such file'}: {path}")


def layout_model(environment: str) -> type[Frozen]:
    """Configuration of an environment's layout: counts, densities, sizes."""
    config = _module(environment, "config")
    model: type[Frozen] = config.model_of(environment) if hasattr(config, "model_of") else config.Config
    return model


def reserved_corridors(environment: str) -> list[Line]:
    """Centre lines of the corridors that stay free of obstacles, whatever experiments exist."""
    config = _module(environment, "config")
    if hasattr(config, "CORRIDORS"):
        corridors = config.CORRIDORS
    elif environment in PLANTINGS:
        corridors = PLANTINGS[environment].corridors
    else:  # packages made for earlier versions have a module of their own for them
        corridors = _module(environment, "corridors").CORRIDORS
    return [Line.through(corners, smooth=False) for corners in corridors]


def build_site(
    file: Path | str, seed: int = 0, layout: Mapping[str, Any] | None = None, *, progress: Progress | None = None
) -> World:
    """Build the world of a site's file, or read it from the cache. See docs/sites.md.

    Args:
        file: the YAML file that says where the site is and which maps it is made of.
        seed: of everything that the maps do not say.
        layout: changes to the file's keys.
        progress: receives the stages of the work.

    Raises:
        ConfigurationError: a key, value or map that cannot be used; the text names it and what is allowed.
        OutputError: it needs more memory than there is.
    """
    path = str(file)
    if not is_environment_file(path):
        raise ConfigurationError(f"{path}: must be the path of a site's file, which ends in .yaml")
    return load_world(path, seed, layout, progress=progress)


def load_world(
    environment: str,
    seed: int = 0,
    layout: Mapping[str, Any] | None = None,
    *,
    cache_folder: Path | None = None,
    progress: Progress | None = None,
) -> World:
    """Read a world from the cache, or build it (see ``build_world``) and store it there.

    Args:
        environment: a name from ``list_environments``, or the path of an environment's file.
        seed: of everything random.
        layout: changes to the environment's configuration.
        cache_folder: by default ``core.cache.cache_folder()``. File names contain a digest of the code, the
            libraries' versions, the layout and the files that it names. A folder that cannot be written is ignored.
        progress: as for ``build_world``.
    """
    check_layout(environment, layout)
    environment, layout = resolved(environment, layout)
    folder = default_cache_folder() if cache_folder is None else cache_folder
    with needed_libraries():
        named = [each for _, path in files_of(layout) for each in with_named(path)]
    inputs = dict(sorted(layout.items())), *file_digests(named), *(_reader_versions() if named else ())
    stem = f"{environment}-{seed}" + (f"_{cache_key((), *inputs)[:12]}" if layout else "")
    path = folder / f"{stem}-{world_key(environment)}.npz"
    return load_or_make(path, read_world, lambda: build_world(environment, seed, layout, progress=progress), save_world)


def _reader_versions() -> Iterator[str]:
    for name in _READERS:
        with suppress(PackageNotFoundError):
            yield f"{name} {version(name)}"


def world_key(environment: str) -> str:
    """Digest of everything besides seed and layout that shapes a world: code, data files, versions of libraries."""
    package = find_environment(environment).package
    modules = [__name__, *(f"{package}.{name}" for name in ("build", "config"))]
    files = data_files()  # the package's and added ones
    if not package.startswith("fieldtruth."):  # `cache_key` finds the package's own modules only
        folders = map(Path, import_module(package).__path__)
        files += sorted(path for folder in folders for path in folder.rglob("*") if _is_source(path))
    return cache_key(modules, [path.read_bytes() for path in files], libraries=_LIBRARIES)


def _is_source(path: Path) -> bool:
    return path.is_file() and "__pycache__" not in path.parts


def world_of(experiment: WorldChoice) -> World:
    """Load the world of an experiment."""
    return load_world(experiment.environment, experiment.seed, experiment.layout)


def _module(environment: str, name: str) -> Any:
    return import_module(f"{find_environment(environment).package}.{name}")


def save_world(path: Path, world: World) -> None:
    """Write a world atomically; missing folders are created.

    The file is a NumPy archive of two arrays of bytes: ``text``, JSON in which each array is its type, shape and place
    in ``data``.
    """
    data = bytearray()
    text = json.dumps(_as_json(world, data)).encode()
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_output(path) as part, part.open("wb") as stream:
        np.savez(stream, allow_pickle=False, text=np.frombuffer(text, np.uint8), data=np.frombuffer(data, np.uint8))


def read_world(path: Path) -> World:
    """Read a file that ``save_world`` wrote; what damage raises is not defined."""
    with np.load(path, allow_pickle=False) as stored:
        text, data = stored["text"].tobytes(), stored["data"]

    def made(entry: dict[str, Any]) -> Any:
        match entry:
            case {"class": name}:
                return _STORED[name](**{key: value for key, value in entry.items() if key != "class"})
            case {"array": [dtype, shape, start]}:
                count = int(np.prod(shape)) * np.dtype(dtype).itemsize
                return data[start : start + count].view(dtype).reshape(shape)
            case {"label": number}:
                return Label(number)
            case {"tuple": values}:
                return tuple(values)
            case _:
                return dict(entry["mapping"])

    world: World = json.loads(text, object_hook=made)
    return replace(world, origin=Origin(*world.origin))


def _as_json(value: Any, data: bytearray) -> Any:
    """Return what JSON can hold of a world, or of a part of it; arrays are appended to ``data``."""
    if is_dataclass(value):
        return {"class": type(value).__name__} | {f.name: _as_json(getattr(value, f.name), data) for f in fields(value)}
    if isinstance(value, np.ndarray):
        data += bytes(-len(data) % _ALIGNED)
        start = len(data)
        data += value.tobytes()
        return {"array": [value.dtype.str, value.shape, start]}
    if isinstance(value, Label):
        return {"label": int(value)}
    if isinstance(value, tuple):
        return {"tuple": [_as_json(each, data) for each in value]}
    if isinstance(value, list):
        return [_as_json(each, data) for each in value]
    if isinstance(value, Mapping):
        return {"mapping": [[key, _as_json(each, data)] for key, each in value.items()]}
    return value
