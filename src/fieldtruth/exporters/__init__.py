# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs to other formats: the table of formats, and what all of them share.

Each format is a module with one function ``write``. Those of a user have a constant ``FORMAT``, too, and are files in a
folder ``formats`` of FIELDTRUTH_PATH, or modules that entry points of the group ``fieldtruth.formats`` name. The output
is written under a temporary name and renamed when it is complete; existing files are never overwritten.
"""

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from functools import reduce
from importlib import import_module
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from fieldtruth.bag.run import Run, open_run
from fieldtruth.core.classes import CLASSES, ClassTable
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning, OutputError
from fieldtruth.core.files import output_errors, output_path, remove, replace_synced
from fieldtruth.core.locks import locked
from fieldtruth.core.parallel import cpu_count, in_order
from fieldtruth.core.progress import Progress, Silent, counted
from fieldtruth.core.readings import Message
from fieldtruth.core.registry import Registry, load_module
from fieldtruth.core.yaml_io import package_data
from fieldtruth.exporters.frames import Member, find_members
from fieldtruth.ontology import LabelMap, label_map_of, own_labels
from fieldtruth.record.folder import new_folder

T = TypeVar("T")
R = TypeVar("R")

DEFAULT_SHARD_MB: Final = 500
DEFAULT_VOXEL_M: Final = 0.1


class Format(NamedTuple):
    """A row of the table."""

    module: str
    """Module with the function ``write(runs, target, options)``; without a dot, one of this package. That of a user's
    ``FORMAT`` is its own, whatever is said here."""
    suffix: str
    """Added to the run's name for the default output path."""
    description: str
    relabels: bool = False
    """True: it has labels, which can be mapped to another ontology."""
    moves: bool = False
    """True: it is read as a motion, and refuses separate frames."""
    joins: bool = False
    """True: several runs can become one output, a sequence each."""
    publishes: bool = False
    """True: the output is a data set of any number of runs, in splits."""
    library: str = ""
    """The library that the extra of the format's name installs, if it needs one."""
    boxes: bool = False
    """True: it takes ``boxes``."""
    voxel_m: bool = False
    """True: it takes ``voxel_m``."""
    maps: tuple[str, ...] = ()
    """Fields of ``MapOptions`` that it takes."""
    copies: bool = False
    """True: it has every message of the bag, whatever its type."""


def _read(name: str, given: Any) -> Format:
    module = load_module(f"fieldtruth_formats.{name}", given) if isinstance(given, Path) else given
    if not isinstance(row := getattr(module, "FORMAT", None), Format):
        raise ConfigurationError(f"{module.__name__}: a format needs FORMAT = Format(...) and write(...)")
    return row._replace(module=module.__name__)


FORMATS: Final[Registry[Format]] = Registry(
    "format",
    "formats",
    ".py",
    _read,
    {name: Format(**row) for name, row in package_data("fieldtruth.exporters", "formats.yaml").items()},
)


class MapOptions(NamedTuple):
    """What maps around the robot are asked for, by a format that has them: arguments of ``LocalMaps``; None: usual."""

    side: float | None = None
    resolution: float | None = None
    layers: Sequence[str] | None = None
    cost: Path | str | None = None

    def given(self) -> dict[str, Any]:
        """Return those that are not None."""
        return {name: value for name, value in self._asdict().items() if value is not None}


class Options(NamedTuple):
    """Arguments of every ``write`` beside the runs and the target."""

    label_map: LabelMap | None
    """Labels to write; None keeps fieldtruth's classes."""
    workers: int
    progress: Progress
    members: Sequence[Member] = ()
    """The runs with split and name, of a format that publishes."""
    shard_bytes: int = DEFAULT_SHARD_MB * 10**6
    """Size of a file that holds many frames; it is smaller than this, unless one frame is larger."""
    boxes: bool = False
    """True: annotations have boxes of whole objects, for which the world is built again."""
    voxel_m: float = DEFAULT_VOXEL_M
    """Edge length [m] of the voxels of a format that has voxels."""
    classes: ClassTable = CLASSES
    """Those of the runs."""
    maps: MapOptions = MapOptions()

    @property
    def labels(self) -> LabelMap:
        """Labels to write."""
        return self.label_map or own_labels(self.classes)

    def of(self, classes: ClassTable, shard_mb: int | None, voxel_m: float | None) -> "Options":
        """Return the options for runs of these classes; None stands for the usual sizes."""
        shard_bytes = self.shard_bytes if shard_mb is None else shard_mb * 10**6
        return self._replace(
            label_map=self.label_map and self.label_map.over(classes),
            classes=classes,
            shard_bytes=shard_bytes,
            voxel_m=self.voxel_m if voxel_m is None else voxel_m,
        )

    def each(self, stage: str, run: Run, items: Sequence[T], work: Callable[[T], R]) -> Iterator[R]:
        """Yield the results of ``work``, which is done by threads, in the order of the items of a run."""
        with self.progress.stage(stage, run.duration_s) as advance:
            yield from counted(in_order(items, work, self.workers), advance, run.duration_s, len(items))


def export(
    path: Path | str | Sequence[Path | str],
    to: str,
    *,
    out: Path | str | None = None,
    label_map: str | None = None,
    split: str | None = None,
    shard_mb: int | None = None,
    boxes: bool = False,
    voxel_m: float | None = None,
    maps: MapOptions | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Export a run to another format.

    Args:
        path: folder of a run, or a bag; several for a format that joins them; folders of runs for one that publishes.
        to: the format, a key of ``FORMATS``.
        out: path of the output, by default beside the (first) bag and named after it.
        label_map: ontology of the labels; None keeps fieldtruth's classes.
        split: train, val or test, of a format that publishes: for runs that are not in a folder of such a name.
        shard_mb: largest size [MB] of a file that holds many frames, of a format that publishes.
        boxes: add boxes of whole objects to annotations, of a format that takes them (``coco``).
        voxel_m: edge length [m] of voxels, by default 0.1, of a format that has them (``occupancy``).
        maps: side, resolution, layers and costs of maps around the robot, of a format that has them (``local-maps``).
        workers: threads; None uses all available cores. The output does not depend on it.
        progress: receives the progress.

    Returns:
        Path of the output.

    Raises:
        UnknownNameError: an unknown format or ontology.
        BagError: a bag cannot be read, or lacks what the format needs.
        OutputError: the output already exists or cannot be written, or the format does not support what is asked.
    """
    _check_options(to, {"publishes": (split, shard_mb) != (None, None), "boxes": boxes, "voxel_m": voxel_m is not None})
    _check_map_options(to, maps or MapOptions())
    paths = [Path(path)] if isinstance(path, Path | str) else [Path(each) for each in path]
    chosen = None if label_map is None else _label_map_for(to, label_map)
    target = None if out is None else _checked_output(to, out)
    members = find_members(paths, split or "train") if FORMATS[to].publishes else []
    runs = [member.run for member in members] or _runs_for(to, paths)
    workers = cpu_count() if workers is None else workers
    options = Options(chosen, workers, progress or Silent(), members, boxes=boxes, maps=maps or MapOptions())
    target = target or _checked_output(to, _default_output(to, paths[0], runs[0]))
    return _write(to, runs, target, options.of(_classes_of(runs), shard_mb, voxel_m))


def _classes_of(runs: Sequence[Run]) -> ClassTable:
    """Classes of all runs.

    Raises:
        ConfigurationError: an id is of different classes.
    """
    try:
        return reduce(ClassTable.joined, (run.classes for run in runs))
    except ValueError as error:
        raise ConfigurationError(str(error)) from error


def _warn_of_left_out(to: str, runs: Sequence[Run], name: str) -> None:
    """Name the sensors whose readings a format cannot hold, to the caller of ``export``."""
    others = sorted({f"{each.name} ({each.topic})" for run in runs for each in run.of(Message)})
    if others and not FORMATS[to].copies:
        text = f"left out of {name}, as {to} cannot hold their readings: {', '.join(others)}"
        warnings.warn(text, FieldtruthWarning, stacklevel=4)


def _check_options(to: str, asked: dict[str, bool]) -> None:
    """Refuse options that a format lacks, by the fields of its row."""
    row = FORMATS.find(to)
    for key, given in asked.items():
        if given and not getattr(row, key):
            missing = "neither splits nor shards" if key == "publishes" else f"no {key}"
            raise OutputError(f"format {to!r} has {missing}; formats that have: {_able(key)}")


def _check_map_options(to: str, maps: MapOptions) -> None:
    """Refuse options of maps that a format lacks."""
    for key in maps.given():
        if key not in FORMATS[to].maps:
            able = ", ".join(name for name, row in FORMATS.items() if key in row.maps)
            raise OutputError(f"format {to!r} has no {key}; formats that have: {able}")


def _write(to: str, runs: Sequence[Run], target: Path, options: Options) -> Path:
    """Write the output in a hidden folder that no other process uses, move it when it is complete, and return it."""
    folder = target.with_name(f".{target.name}.part")
    part = folder / target.name
    write = _writer(to)
    with new_folder(folder, target), ExitStack() as stack:
        stack.callback(_remove_empty, folder)
        stack.enter_context(locked(folder))
        stack.callback(remove, part)
        with output_errors(target):
            remove(part)  # of a process that was killed
            write(runs, part, options)
            _state_assumptions(runs, part)
            replace_synced(part, target)
    _warn_of_left_out(to, runs, target.name)
    return target


def _state_assumptions(runs: Sequence[Run], target: Path) -> None:
    """Add to the README of an output, if it has one, what was assumed of runs without an experiment."""
    lines = [f"{run.name}: {run.assumed}.\n" for run in runs if run.assumed]
    for readme in (target / name for name in ("README.md", "README.txt")):
        if lines and readme.is_file():
            with readme.open("a", encoding="utf-8") as file:
                file.write("\n" + "".join(lines))


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):  # another process has just begun to use it
        folder.rmdir()


def _checked_output(to: str, out: Path | str) -> Path:
    return output_path(out, single="." in FORMATS[to].suffix)


def _default_output(to: str, path: Path, run: Run) -> Path:
    """Beside the bag, named after it; for a folder of runs, beside that folder."""
    folder = path.resolve()
    if folder.is_dir() and folder != run.folder.resolve():
        return folder.with_name(folder.name + FORMATS[to].suffix)
    return run.folder / (run.name + FORMATS[to].suffix)


def _able(key: str) -> str:
    """Return the names of the formats whose row is true in a column."""
    return ", ".join(name for name, row in FORMATS.items() if getattr(row, key))


def _writer(to: str) -> Callable[[Sequence[Run], Path, Options], None]:
    try:
        write: Callable[[Sequence[Run], Path, Options], None]
        module = FORMATS[to].module
        write = import_module(module if "." in module else f"fieldtruth.exporters.{module}").write
    except ModuleNotFoundError as error:
        library = FORMATS[to].library
        if not library or (error.name or "").partition(".")[0] != library:
            raise
        raise OutputError(f"the {library} library is not installed; run: pip install 'fieldtruth[{to}]'") from error
    return write


def _label_map_for(to: str, name: str) -> LabelMap:
    found = label_map_of(name)
    if not FORMATS[to].relabels:
        raise OutputError(f"format {to!r} has no labels to map; formats with labels: {_able('relabels')}")
    return found


def _runs_for(to: str, paths: Sequence[Path | str]) -> list[Run]:
    if len(paths) > 1 and not FORMATS[to].joins:
        able = _able("joins")
        raise OutputError(f"format {to!r} takes one run, got {len(paths)}; formats that join several: {able}")
    runs = [open_run(path) for path in paths]
    if FORMATS[to].moves and (still := next((run for run in runs if run.is_frames), None)):
        able = _able("publishes")
        raise OutputError(
            f"{still.bag} has separate frames, and format {to!r} is a motion; data sets of frames: {able}"
        )
    bags = [run.bag.resolve() for run in runs]
    if twice := next((run.bag for run, bag in zip(runs, bags, strict=True) if bags.count(bag) > 1), None):
        raise OutputError(f"{twice} is given twice; each run can be one sequence")
    return runs
