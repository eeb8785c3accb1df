# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a run as images, CSV, text files and class shares, as the paper publishes it (section 5).

The bag is read once. Several threads write images and clouds and count classes; the reading thread writes the text.
Numbers have the fewest digits that read back to the same bits. Clouds are formatted by orjson: 25,000
points take 7 ms of a core's time; NumPy's savetxt takes 39 ms, Python's own formatting 34 ms and pandas 66 ms.
"""

import csv
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from io import StringIO
from operator import attrgetter
from pathlib import Path
from textwrap import fill, wrap
from typing import Any, Final, NamedTuple, TextIO

import numpy as np
import orjson
import yaml
from numpy.typing import NDArray

import fieldtruth
from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import Lens, read_objects, read_poses
from fieldtruth.bag.messages import JOINTS
from fieldtruth.bag.readings import Readings
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source, sources_of
from fieldtruth.core import readings as kinds
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.classes import ClassTable
from fieldtruth.core.png import encode_png, ids_png
from fieldtruth.core.readings import Cloud, Image, Joints, Message, Odometry, Reading, WheelSpeeds
from fieldtruth.core.yaml_io import package_data
from fieldtruth.datasets.items import ROLES
from fieldtruth.experiment.sensor_config import BASE
from fieldtruth.exporters import Options
from fieldtruth.exporters.files_sheet import write_sheet
from fieldtruth.exporters.frames import intensity_is_class, noun_of
from fieldtruth.exporters.image_files import flow_flo, flow_png, metres_npy, millimetres_png, normals_png
from fieldtruth.ontology import LabelMap

README: Final = "README.txt"
SHEET: Final = "data_proportion.xlsx"
CALIBRATION: Final = "calibration.yaml"
OBJECTS: Final = "instances.csv"
_POSES: Final = (table.MODEL_STATES, table.ODOMETRY)
"""Topics of the true poses."""
_TEXTS: Final = package_data("fieldtruth.exporters", "files.yaml")
"""Tables of the files with a line, and of the folders with a file per message, and paragraphs of the README."""
Row = Callable[[Any], tuple[Any, ...]]
"""Returns the values of a message."""


class Folder(NamedTuple):
    """A folder with a file per message of a topic."""

    topic: str
    msgtype: str
    path: str
    suffix: str
    about: str


class TextFile(NamedTuple):
    """A file with a line per message of a topic."""

    topic: str
    msgtype: str
    path: str
    """Below the output folder."""
    columns: str
    """Names of the columns, in order; the first is the stamp."""
    about: str
    row: Row | None
    """None for the true poses."""


class _Encoded(NamedTuple):
    """Files of a reading, bytes by folder, and counts by class id (classes,) of "pixels" or "points" of a sensor."""

    files: Mapping[str, bytes]
    counts: Mapping[tuple[str, str], Counts] = {}


class _Writer(NamedTuple):
    """Readings, and what makes files of one, or a line of a text file."""

    readings: Readings
    encode: Callable[[Any], _Encoded | str]
    path: str = ""
    """Of the text file."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``, with a README.txt that describes what it has and what is missing.

    Raises:
        BagError: the bag has no messages of sensors, a topic has another type, two messages of a topic have the same
            stamp, an image or cloud cannot be read or has an unknown class, or the bag is damaged.
    """
    (run,) = runs
    sources = sources_of(run.rig, disabled=True).values()
    all_folders, all_texts = list(folders(sources, options.label_map)), list(text_files(run, sources))
    outputs: list[Folder | TextFile] = [*all_folders, *all_texts]
    known = {each.topic: each.msgtype for each in outputs}
    _check(run, known)
    _check_paths(run, [each.path for each in outputs])
    suffixes = {folder.path: folder.suffix for folder in all_folders if folder.topic in run.counts}
    for path in suffixes:
        (target / path).mkdir(parents=True)
    run.streams([topic for topic in {*known, table.ODOMETRY} - {table.MODEL_STATES} if topic in run.counts])
    writers = [*_image_writers(run, options.label_map), *_text_writers(run, all_texts)]
    counts = _write_readings(run, writers, suffixes, target, options)
    for text in all_texts:
        if text.topic in run.counts and text.row is None:
            with (target / text.path).open("w", encoding="ascii", newline="\n") as file:
                file.writelines(pose_lines(run, text.topic))
    per_run = _write_per_run(run, target, counts, options.label_map)
    about = readme(run, all_folders, all_texts, per_run, options.label_map)
    (target / README).write_text(about, encoding="utf-8")


def _check(run: Run, known: Mapping[str, str]) -> None:
    sensors = [topic for topic in known if topic not in _POSES]
    if run.counts.keys().isdisjoint(sensors):
        has = ", ".join(sorted(run.counts))
        raise BagError(f"{run.bag} has no messages of sensors; expected {', '.join(sensors)}; available: {has}")
    for topic, msgtype in known.items():
        if topic in run.counts and run.msgtypes[topic] != msgtype:
            raise BagError(f"{topic} of {run.bag} must be {msgtype}, got {run.msgtypes[topic]}")


def _check_paths(run: Run, paths: Sequence[str]) -> None:
    """Check that no two topics have the same path, as clouds of ``img_left`` and images of ``left`` would."""
    if twice := next((path for path in paths if paths.count(path) > 1), None):
        raise BagError(f"{run.bag}: two sensors of the rig would have the same path {twice} in this format")


# ---------------------------------------------------------------------------------------------------------------------
# Readings, in time order


def _write_readings(
    run: Run, writers: Sequence[_Writer], suffixes: Mapping[str, str], target: Path, options: Options
) -> dict[tuple[str, str], Counts]:
    """Write files and lines of all readings; return the counts of the classes."""
    jobs = sorted(
        (stamp, k, row) for k, each in enumerate(writers) for row, stamp in enumerate(each.readings.stamps_ns.tolist())
    )
    counts: dict[tuple[str, str], Counts] = {}

    def work(job: tuple[int, int, int]) -> tuple[str, str] | Mapping[tuple[str, str], Counts]:
        stamp, k, row = job
        encoded = writers[k].encode(writers[k].readings.read(row))
        if isinstance(encoded, str):
            return writers[k].path, encoded
        for folder, data in encoded.files.items():
            (target / folder / f"{stamp}{suffixes[folder]}").write_bytes(data)
        return encoded.counts

    with ExitStack() as stack:
        files = {path: stack.enter_context(_opened(target / path)) for path in {each.path for each in writers} - {""}}
        for found in options.each("write files", run, jobs, work):
            if isinstance(found, tuple):
                files[found[0]].write(found[1])
            else:
                for key, more in found.items():
                    counts[key] = counts.get(key, 0) + more
    return counts


def _opened(path: Path) -> TextIO:
    path.parent.mkdir(parents=True, exist_ok=True)
    return path.open("w", encoding="ascii", newline="\n")


def _text_writers(run: Run, texts: Sequence[TextFile]) -> Iterator[_Writer]:
    for text in texts:
        if text.topic in run.counts and text.row is not None:
            yield _Writer(run.messages(text.topic), partial(_line, text.row), text.path)


def _line(row: Row, reading: Message) -> str:
    return line(reading.stamp_ns, row(reading.value))


def line(stamp: int, numbers: Iterable[float]) -> str:
    """Return a line of text: the stamp and the numbers, separated by spaces."""
    return " ".join(map(str, (stamp, *numbers))) + "\n"


def points_csv(points: NDArray[Any]) -> bytes:
    """CSV of points (n, 4): x, y, z [m] and reflectivity, without a decimal point if it is whole; not finite is nan."""
    if not len(points):
        return b""
    nested: bytes = orjson.dumps(np.ascontiguousarray(points), option=orjson.OPT_SERIALIZE_NUMPY)
    lines = nested[2:-2].replace(b"],[", b"\n") + b"\n"
    return lines.replace(b".0\n", b"\n").replace(b"null", b"nan")


def _image_writers(run: Run, label_map: LabelMap | None) -> Iterator[_Writer]:
    """Each part of the images is written, also at a stamp at which another is missing."""
    encoders: Mapping[str, Callable[[str, Any], _Encoded]] = {
        "photo": lambda name, image: _Encoded({f"img_{name}": encode_png(image.photo)}),
        "label": partial(_tag, run.classes, label_map),
        "depth": _depth,
        "instance": lambda name, image: _Encoded({f"instances_{name}": ids_png(image.instance)}),
        "normal": lambda name, image: _Encoded({f"normals_{name}": normals_png(image.normal)}),
        "flow": _flow,
        "part": lambda name, image: _Encoded({f"parts_{name}": encode_png(image.part)}),
        "passability": _passability,
    }
    for view in run.of(Image, recorded=False):
        for part in view.recorded(run.counts):
            yield _Writer(run.readings(view.name, [part]), partial(encoders[part], view.label))
    for sensor in run.of(Cloud):
        yield _Writer(run[sensor.name], partial(_cloud, run.classes, sensor.name, label_map))


def _tag(classes: ClassTable, label_map: LabelMap | None, name: str, image: Image) -> _Encoded:
    assert image.label is not None
    label = image.label
    files = {f"img_{name}_tag": encode_png(classes.palette[label])}
    if label_map is not None:
        ids = label_map.ids[label]
        files |= {
            f"img_{name}_label_id": encode_png(ids),
            f"img_{name}_label_color": encode_png(label_map.colours()[ids]),
        }
    return _Encoded(files, {("pixels", name): _count(label, classes)})


def _depth(name: str, image: Any) -> _Encoded:
    return _Encoded({f"depth_{name}": millimetres_png(image.depth), f"depth_{name}_raw": metres_npy(image.depth)})


def _flow(name: str, image: Any) -> _Encoded:
    return _Encoded({f"flow_{name}": flow_png(image.flow), f"flow_{name}_raw": flow_flo(image.flow)})


def _passability(name: str, image: Any) -> _Encoded:
    share = np.rint(255.0 * image.passability[..., 0]).astype(np.uint8)
    return _Encoded(
        {
            f"passability_{name}": encode_png(share),
            f"force_{name}": metres_npy(image.passability[..., 1]),
        }
    )


def _cloud(classes: ClassTable, name: str, label_map: LabelMap | None, cloud: Cloud) -> _Encoded:
    last = cloud.others.get("intensity", cloud.label)
    files = {name: points_csv(np.concatenate([cloud.xyz, last[:, None]], axis=1, dtype=cloud.xyz.dtype))}
    if label_map is not None:
        files[f"{name}_label"] = label_map.ids[cloud.label].astype("<u4").tobytes()
    return _Encoded(files, {("points", name): _count(cloud.label, classes)})


def _count(label: NDArray[np.uint8], classes: ClassTable) -> Counts:
    return np.bincount(label.reshape(-1), minlength=len(classes))


# ---------------------------------------------------------------------------------------------------------------------
# Text files


def _joints(message: Any) -> tuple[float, ...]:
    return tuple(  # nan of a wheel that the robot does not have
        float(part[message.name.index(joint)]) if joint in message.name else float("nan")
        for part in (message.position, message.velocity)
        for joint in JOINTS
    )


_ROWS: Final[Mapping[type[Reading], Row]] = {WheelSpeeds: lambda message: (np.float32(message.data),), Joints: _joints}
"""Values of messages that are not fields of them."""


def text_files(run: Run, sources: Collection[Source]) -> Iterator[TextFile]:
    """Text files of all topics that a run may have; of the two sources of true poses only the better one."""
    robot = run.rig.robot
    missing = "" if robot.caster is None else "; nan: the robot does not have this wheel"
    outputs = [output for sensor in run.rig.sensors for output in sensor.outputs_on(robot)]
    possible = {topic.name for output in outputs for topic in output.topics}
    for row in _TEXTS["texts"]:
        kind = getattr(kinds, row["reading"])
        values = attrgetter(*row["values"]) if "values" in row else _ROWS[kind]
        for source in (each for each in sources if each.type is kind):
            for part, topic in source.topics.items():
                if topic not in possible:
                    continue  # of a wheel that the robot lacks
                words = {
                    "file": _TEXTS["names"].get(source.name, source.name),
                    "frame": source.frame,
                    "part": part,
                    "words": part.replace("_", " "),
                    "missing": missing,
                }
                path, about = (row[key].format(**words) for key in ("path", "about"))
                yield TextFile(topic, source.msgtypes[topic], path, row["columns"], about, values)
            if kind is Odometry:
                speeds = attrgetter("linear.x", "angular.z")
                yield TextFile(table.COMMANDS, "geometry_msgs/msg/Twist", **_TEXTS["commands"], row=speeds)
    topic = next(topic for topic in _POSES if topic in run.counts or topic == _POSES[-1])
    msgtype = {table.MODEL_STATES: "gazebo_msgs/msg/ModelStates", table.ODOMETRY: "nav_msgs/msg/Odometry"}[topic]
    yield TextFile(topic, msgtype, **_TEXTS["truth"], row=None)


def pose_lines(run: Run, topic: str) -> Iterator[str]:
    """Lines of the true poses of a topic."""
    poses = read_poses(run, topic).trajectory
    rows = np.concatenate([poses.position, transforms.xyzw_from_wxyz(poses.quaternion_wxyz)], axis=1).tolist()
    return (line(stamp, tuple(row)) for stamp, row in zip(poses.stamps_ns.tolist(), rows, strict=True))


# ---------------------------------------------------------------------------------------------------------------------
# Folders and their description


def folders(sources: Collection[Source], label_map: LabelMap | None) -> Iterator[Folder]:
    """Folders of all topics that a run with these sensors may have."""
    for kind, rows in _TEXTS["folders"].items():
        for source in (each for each in sources if each.type is getattr(kinds, kind)):
            words = {"name": source.label, "frame": source.frame, "map": label_map and label_map.name}
            words["intensity"] = "class id" if intensity_is_class(source) else "reflectivity, 1 for a white surface"
            for row in rows:
                if label_map is not None or "{map}" not in row["about"]:
                    topic = source.topics[row["part"]]
                    path, about = (row[key].format(**words) for key in ("path", "about"))
                    yield Folder(topic, source.msgtypes[topic], path, row["suffix"], about)


def readme(
    run: Run,
    all_folders: Sequence[Folder],
    all_texts: Sequence[TextFile],
    per_run: Sequence[tuple[str, str]],
    label_map: LabelMap | None,
) -> str:
    """Text of the README: existing and missing files.

    Args:
        run: the run.
        all_folders: folders of every topic; the run may lack some.
        all_texts: text files of every topic.
        per_run: names of the other files, with a description of each.
        label_map: the ontology of labels that were written beside ours.
    """
    here = [(f"{f.path}/<ns>{f.suffix}", f.about) for f in all_folders if f.topic in run.counts]
    texts = [text for text in all_texts if text.topic in run.counts]
    missing = [f"{f.path}/ ({f.topic})" for f in all_folders if f.topic not in run.counts]
    missing += [f"{text.path} ({text.topic})" for text in all_texts if text.topic not in run.counts]
    blocks = [
        f"{run.name}, {run.duration_s:.3f} s, in the format of the paper below.\n"
        f"Written by fieldtruth {fieldtruth.__version__} from {run.bag.name}.",
        fill(_TEXTS["stamps"], 110),
        _section("A file per message; <ns> is its stamp", here),
        _section(
            "A line per message; columns are separated by spaces", [(t.path, f"{t.columns}\n{t.about}") for t in texts]
        ),
        fill(_TEXTS["numbers"], 110),
        _section("One file per run", per_run),
        _section("Missing, because the bag does not have the topic", [(each, "") for each in missing]),
        _classes(run.classes),
        "" if label_map is None else _other_classes(run.classes, label_map),
        _TEXTS["paper"],
    ]
    return "\n\n".join(block for block in blocks if block) + "\n"


def _section(title: str, rows: Sequence[tuple[str, str]]) -> str:
    if not rows:
        return ""
    width = max(len(name) for name, _ in rows) + 2
    lines = [title, "-" * len(title)]
    for name, about in rows:
        first, *rest = [text for part in about.split("\n") for text in wrap(part, 110 - width) or [""]]
        lines.append(f"{name:<{width}}{first}".rstrip())
        lines += [" " * width + text for text in rest]
    return "\n".join(lines)


def _classes(classes: ClassTable) -> str:
    rows = [(f"{row.label:>3}  {row.name}", " ".join(map(str, row.rgb or ()))) for row in classes.coloured]
    return _section("Classes: id, name, colour in the tag images (red, green, blue)", rows)


def _other_classes(classes: ClassTable, label_map: LabelMap) -> str:
    """Return the section with the class of the ontology that each of our classes becomes."""
    rows = []
    for row in classes.coloured:
        number = int(label_map.ids[row.label])
        other = label_map.classes[number]
        rows.append((f"{row.label:>3}  {row.name}", f"{number} {other.name}, colour {' '.join(map(str, other.rgb))}"))
    return _section(f"Classes in {label_map.name}", rows)


# ---------------------------------------------------------------------------------------------------------------------
# Files of the whole run


def _write_per_run(
    run: Run, target: Path, counts: Mapping[tuple[str, str], Counts], label_map: LabelMap | None
) -> list[tuple[str, str]]:
    """Write calibration, names of objects and class shares as far as the run has them; return file names and texts."""
    if calibration := calibration_yaml(run):
        (target / CALIBRATION).write_text(calibration, encoding="utf-8")
    if table.MODEL_STATES in run.counts and run.of(Image, "instance"):
        (target / OBJECTS).write_text(_objects(run), encoding="utf-8")
    if any(found.any() for found in counts.values()):
        labels = [view.label for view in run.sensors.values()]
        pixels, points = (
            {name: counts[what, name] for name in labels if (what, name) in counts} for what in ("pixels", "points")
        )
        by_intensity = all(map(intensity_is_class, run.of(Cloud)))
        noun = noun_of(run.of(Cloud))
        write_sheet(
            target / SHEET, run.name, pixels, points, label_map,
            by_intensity=by_intensity, noun=noun, classes=run.classes,
        )  # fmt: skip
    return [(name, about) for name, about in _TEXTS["per_run"].items() if (target / name).exists()]


def _objects(run: Run) -> str:
    """CSV of the ids and names of all objects, which are the rows of the topic with the objects."""
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows(enumerate(read_objects(run)[0]))
    return text.getvalue()


# ---------------------------------------------------------------------------------------------------------------------
# Calibration


def calibration_yaml(run: Run) -> str:
    """YAML of CameraInfo and /tf_static, as far as the run has them; empty if it has neither.

    Raises:
        BagError: the bag is damaged.
    """
    views = [view for view in run.of(Image, recorded=False) if run.calibration.has_lens(view.name)]
    lenses = {view.label: run.calibration.lens(view.name) for view in views}
    content: dict[str, Any] = {}
    if lenses:
        content[f"{ROLES[Image].key}s"] = {name: _lens(lens) for name, lens in lenses.items()}
    baselines = {
        view.device: float(-lenses[view.label].P[0, 3] / lenses[view.label].P[0, 0])
        for view in views
        if view.side == "right" and lenses[view.label].P[0, 0]
    }
    if len(baselines) == 1:
        content["baseline_m"] = baselines.popitem()[1]
    elif baselines:
        content["baseline_m"] = baselines
    if table.TF_STATIC in run.counts:
        content["frames"] = _frames(run)
    if not content:
        return ""
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)
    return f"{_TEXTS['calibration']}{text}"


def _lens(lens: Lens) -> dict[str, Any]:
    return {
        "frame": lens.frame,
        "width": lens.width,
        "height": lens.height,
        "distortion_model": lens.model,
        "D": lens.D.tolist(),
        **{name: getattr(lens, name).tolist() for name in "KRP"},
    }


def _frames(run: Run) -> dict[str, Any]:
    static = run.calibration.static
    described: dict[str, Any] = {}
    for frame, (parent, parent_from_frame) in static.parents.items():
        wxyz = transforms.quaternion_wxyz_from_rotation(parent_from_frame[:3, :3])
        described[frame] = {
            "parent": parent,
            "translation": _rounded(parent_from_frame[:3, 3]),
            "quaternion_xyzw": _rounded(transforms.xyzw_from_wxyz(wxyz)),
        }
        with suppress(BagError):  # a frame that is not connected to base_link
            described[frame][f"{BASE}_from_frame"] = _rounded(static.base_from(frame))
    return described


def _rounded(values: Array) -> Any:
    """Values as lists; below 1e-12 is rounding error and becomes 0."""
    return (np.round(values, 12) + 0.0).tolist()
