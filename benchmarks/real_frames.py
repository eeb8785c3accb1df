# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Real frames with labels, read as their data sets have them, in the few classes that all of them have.

``frames_of`` finds the layout of a folder. A pair of an image layout is an image, (h, w, 3) uint8 RGB, and a mask,
(h, w) uint8 of ``IMAGE_CLASSES``; one of a cloud layout is points, (n, 4) float32 x, y, z [m] and remission, and
labels, (n,) uint8 of ``CLOUD_CLASSES``. Pixels and points of other classes, or without one, are ``IGNORED``.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from fieldtruth.core.classes import CLASSES, as_key
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.ontology import label_map_of

IMAGE_CLASSES: Final = ("sky", "trail", "grass", "vegetation", "obstacle")
CLOUD_CLASSES: Final = ("ground", "bush", "tree")
IGNORED: Final = 255
_UNKNOWN: Final = 254

MERGED_IMAGE: Final = {"sky": ("sky",), "ground": ("trail", "grass"), "vegetation": ("vegetation",)}
"""Classes that images of every layout tell apart, by those of ``IMAGE_CLASSES`` in each."""
MERGED_CLOUD: Final = {"ground": ("ground",), "vegetation": ("bush", "tree")}
"""Classes that clouds of every layout tell apart, by those of ``CLOUD_CLASSES`` in each."""

_IN_IMAGES: Final = {
    "sky": "sky",
    "trail": "trail dirt sand mud gravel mulch asphalt concrete rock_bed puddle cobble soil bikeway sidewalk"
    " road_marking pedestrian_crossing rough_trail smooth_trail",
    "grass": "ground grass low_grass leaves moss crops other_terrain traversable_grass traversable",
    "vegetation": "high_grass tree treetop trunk bush forest tree_crown tree_trunk tree_root hedge scenery_vegetation"
    " tree_trunk tree_foliage high_vegetation non_traversable_low_vegetation non_traversable",
    "obstacle": "rock rubble log debris pole post lamp_post street_light trash_bin table bench picnic_table cable wire"
    " object container/generic_object other_object obstacle container barrel pipe vehicle car truck bus trailer caravan"
    " on_rails heavy_machinery military_vehicle bicycle motorcycle kick_scooter person rider animal building structure"
    " wall fence barrier guard_rail bridge tunnel sign traffic_sign misc_sign traffic_light traffic_cone road_block"
    " boom_barrier barrier_tape curb rail_track",
}
"""Names of classes of all data sets and ours, by the class that they are here. Others, as water, are ignored."""
_IN_CLOUDS: Final = {
    "ground": f"{_IN_IMAGES['trail']} {_IN_IMAGES['grass']} high_grass road parking other_ground lane_marking terrain",
    "bush": "bush hedge scenery_vegetation",
    "tree": "tree treetop trunk forest tree_crown tree_trunk vegetation",
}
_ORFD: Final = {0xFFFFFF: "traversable", 0x000000: "non_traversable", 0x808080: "sky"}
_WILDSCENES: Final = (
    *("unlabelled", "asphalt", "dirt", "mud", "water", "gravel", "other_terrain", "tree_trunk", "tree_foliage", "bush"),
    *("fence", "structure", "pole", "vehicle", "rock", "log", "other_object", "sky", "grass"),
)
_SEMANTICKITTI: Final = {
    40: "road",
    44: "parking",
    48: "sidewalk",
    49: "other_ground",
    60: "lane_marking",
    70: "vegetation",
    71: "trunk",
    72: "terrain",
} | dict.fromkeys((0, 1, 10, 11, 13, 15, 16, 18, 20, 30, 31, 32, 50, 51, 52, 80, 81, 99, *range(252, 260)), "other")


class Source(NamedTuple):
    """Where a layout has its images or scans, and how the name of their labels differs."""

    files: str
    """Glob below any folder."""
    ending: str
    """End of the name of the labels, in place of that of the files after their last ``*``."""
    folder: tuple[str, str] = ("", "")
    """Folder of the files, and that of the labels in its place; the same if empty."""


@dataclass(frozen=True)
class Layout:
    """Files of a data set and its classes."""

    name: str
    sources: Sequence[Source]
    classes: Mapping[int, str]
    """Names of classes by id, or by colour as 0xRRGGBB."""
    has_colours: bool = False
    is_cloud: bool = False
    is_merged: bool = False
    """True if the classes tell only ``MERGED_IMAGE`` or ``MERGED_CLOUD`` apart."""
    is_numbered: bool = False
    """True if folders of pairs have numbers; else pairs are numbered in their order."""

    @property
    def coarse_classes(self) -> tuple[str, ...]:
        """Names of the classes of masks or labels."""
        return CLOUD_CLASSES if self.is_cloud else IMAGE_CLASSES

    def table(self) -> NDArray[np.uint8]:
        """Classes here by id, or by colour as 0xRRGGBB."""
        groups = _IN_CLOUDS if self.is_cloud else _IN_IMAGES
        table = np.full(1 << 24 if self.has_colours else 1 << 16, _UNKNOWN, np.uint8)
        for number, name in self.classes.items():
            table[number] = _coarse(name, groups)
        return table


def _coarse(name: str, groups: Mapping[str, str]) -> int:
    found = (k for k, names in enumerate(groups.values()) if name in names.split())
    return next(found, IGNORED)


def of_names(names: Sequence[str], *, clouds: bool = False) -> NDArray[np.uint8]:
    """Return the class here by the index of a name, ``IGNORED`` of a name that no class here has."""
    keys = [as_key(name) for name in names]
    groups = _IN_CLOUDS if clouds else _IN_IMAGES
    return np.array([list(groups).index(key) if key in groups else _coarse(key, groups) for key in keys], np.uint8)


def of_own_classes() -> NDArray[np.uint8]:
    """(20,) class of ``IMAGE_CLASSES`` by our class id."""
    return of_names([row.key for row in CLASSES])


def _ontology(name: str, *, by_colour: bool = False) -> dict[int, str]:
    """Names of the classes of one of our label maps, by id or by colour."""
    classes = label_map_of(name).classes
    return {_packed(np.array(c.rgb)).item() if by_colour else n: as_key(c.name) for n, c in classes.items()}


def _packed(rgb: NDArray[Any]) -> NDArray[Any]:
    """Colours (..., 3) as 0xRRGGBB."""
    wide = rgb.astype(np.uint32)
    return (wide[..., 0] << 16) | (wide[..., 1] << 8) | wide[..., 2]


_GOOSE_ENDINGS: Final = ("_windshield_vis.png", "_camera_left.png", "_front.png", "_realsense.png")
LAYOUTS: Final = (
    Layout(
        "ycor", [Source("rgb.jpg", "labels.png")], _ontology("ycor", by_colour=True), has_colours=True, is_numbered=True
    ),
    Layout(
        "rugd",
        [Source("RUGD_frames-with-annotations/*/*.png", ".png", ("RUGD_frames-with-annotations", "RUGD_annotations"))],
        _ontology("rugd", by_colour=True),
        has_colours=True,
    ),
    Layout(
        "goose",
        [Source(f"images/*/*/*{ending}", "_labelids.png", ("images", "labels")) for ending in _GOOSE_ENDINGS],
        _ontology("goose"),
    ),
    Layout("wildscenes", [Source("image/*.png", ".png", ("image", "indexLabel"))], dict(enumerate(_WILDSCENES))),
    Layout(
        "orfd",
        [Source("image_data/*.png", "_fillcolor.png", ("image_data", "gt_image"))],
        _ORFD,
        has_colours=True,
        is_merged=True,
    ),
    Layout(
        "rellis",
        [
            Source("pylon_camera_node/*.jpg", ".png", ("pylon_camera_node", "pylon_camera_node_label_id")),
            Source("frame*.jpg", ".png"),
        ],
        _ontology("rellis"),
    ),
    Layout(
        "rellis-clouds",
        [
            Source(f"{scans}_kitti_bin/*.bin", ".label", (f"{scans}_kitti_bin", f"{scans}_semantickitti_label_id"))
            for scans in ("os1_cloud_node", "vel_cloud_node")
        ]
        + [Source("[0-9]*.bin", ".label")],
        _ontology("rellis"),
        is_cloud=True,
    ),
    Layout(
        "goose-clouds",
        [
            Source("lidar/*/*/*_vls128.bin", "_goose.label", ("lidar", "labels")),
            Source("lidar/*/*/*_pcl.bin", "_goose.label", ("lidar", "labels")),
            Source("velodyne/*/*/*_velodyne.bin", "_velodyne.label", ("velodyne", "labels")),
        ],
        _ontology("goose"),
        is_cloud=True,
    ),
    Layout(
        "semantickitti",
        [Source("sequences/*/velodyne/*.bin", ".label", ("velodyne", "labels"))],
        _SEMANTICKITTI,
        is_cloud=True,
        is_merged=True,
    ),
)
"""Layouts, as the data sets' own pages and tools document them:

- YCOR: theairlab.org/yamaha-offroad-dataset; folders ``train/iid000123`` of an image and its labels by colour.
- RUGD: rugd.vision; colours of RUGD_annotation-colormap.txt.
- GOOSE, GOOSE-Ex: goose-dataset.de/docs/dataset-structure, names of files in github.com/FraunhoferIOSB/goose_dataset.
- WildScenes: github.com/csiro-robotics/WildScenes, ids in wildscenes/tools/utils2d.py.
- ORFD: github.com/chaytonmin/Off-Road-Freespace-Detection; white is traversable, grey the sky (unreachable).
- RELLIS-3D: github.com/unmannedlab/RELLIS-3D, README and utils/example, whose files lie in one folder.
- SemanticKITTI: github.com/PRBonn/semantic-kitti-api, config/semantic-kitti.yaml; its vegetation is bushes and trees.
"""


class Pair(NamedTuple):
    """Files of a pair."""

    number: int
    file: Path
    labels: Path


@dataclass(frozen=True)
class Frames:
    """Pairs of a folder, read when they are asked for."""

    layout: Layout
    pairs: Sequence[Pair]

    def __len__(self) -> int:
        """Return the number of pairs."""
        return len(self.pairs)

    def __getitem__(self, index: int) -> tuple[NDArray[Any], NDArray[np.uint8]]:
        """Read image and mask, or points and labels.

        Raises:
            ConfigurationError: an unreadable file, labels of another size, or an unknown id or colour.
        """
        pair = self.pairs[index]
        read = _read_cloud if self.layout.is_cloud else _read_image
        values, codes = read(pair, self.layout.has_colours)
        labels = _table(self.layout.name)[np.minimum(codes, 0xFFFFFF if self.layout.has_colours else 0xFFFF)]
        if (labels == _UNKNOWN).any():
            code = int(codes[labels == _UNKNOWN][0])
            what = (
                f"colour ({code >> 16}, {code >> 8 & 255}, {code & 255})" if self.layout.has_colours else f"id {code}"
            )
            raise ConfigurationError(f"{pair.labels}: {what} is no class of {self.layout.name}")
        return values, labels

    def between(self, start: int, end: int) -> "Frames":
        """Return the pairs with numbers from ``start`` to below ``end``.

        Raises:
            ConfigurationError: no pair has such a number.
        """
        kept = [pair for pair in self.pairs if start <= pair.number < end]
        if not kept:
            numbers = f"{self.pairs[0].number} to {self.pairs[-1].number}"
            raise ConfigurationError(f"no pairs from {start} to below {end}; the folder has numbers {numbers}")
        return Frames(self.layout, kept)

    def spread(self, count: int) -> "Frames":
        """Return ``count`` of the pairs, evenly spaced.

        Raises:
            ConfigurationError: there are fewer.
        """
        if not 1 <= count <= len(self):
            raise ConfigurationError(f"{count} pairs are asked for; there are {len(self)}")
        at = np.round(np.linspace(0, len(self) - 1, count)).astype(int) if count > 1 else [len(self) // 2]
        return Frames(self.layout, [self.pairs[k] for k in at])


def frames_of(folder: Path, layout: str = "", *, clouds: bool = False) -> Frames:
    """Find the pairs of a folder in the order of its data set.

    Args:
        folder: of the data set, or a part of it that has folders of images and labels.
        layout: name of the layout; the first that has pairs there if empty.
        clouds: whether to look for clouds.

    Raises:
        ConfigurationError: no such folder or layout, or no pairs.
    """
    if not folder.is_dir():
        raise ConfigurationError(f"{folder} is not a folder")
    named = [each for each in LAYOUTS if each.is_cloud == clouds and layout in ("", each.name)]
    if not named:
        allowed = ", ".join(each.name for each in LAYOUTS if each.is_cloud == clouds)
        raise ConfigurationError(f"layout {layout!r} must be one of {allowed}")
    for each in named:
        if pairs := _pairs(folder, each):
            return Frames(each, pairs)
    names = ", ".join(each.name for each in named)
    raise ConfigurationError(f"{folder} has no pairs of {'a scan' if clouds else 'an image'} and labels as {names}")


def _pairs(folder: Path, layout: Layout) -> list[Pair]:
    """Pairs in the order of their names; files without labels are left out, as data sets have such."""
    found = []
    for source in layout.sources:
        ending = source.files.rpartition("*")[2].rpartition("/")[2] if "*" in source.files else source.files
        for file in folder.rglob(source.files):
            parts = [*file.relative_to(folder).parts[:-1], file.name.removesuffix(ending) + source.ending]
            if source.folder[0]:
                at = len(parts) - 1 - parts[::-1].index(source.folder[0])
                parts[at] = source.folder[1]
            if (labels := folder.joinpath(*parts)).is_file():
                found.append((file, labels))
    found.sort()
    numbers = [_number(file) if layout.is_numbered else k for k, (file, _) in enumerate(found)]
    return [Pair(number, file, labels) for number, (file, labels) in zip(numbers, found, strict=True)]


def _number(file: Path) -> int:
    """Return the number in the name of a file's folder.

    Raises:
        ConfigurationError: it has none.
    """
    digits = re.search(r"\d+$", file.parent.name)
    if digits is None:
        raise ConfigurationError(f"{file.parent} must end with a number, as 0012 or iid000012 do")
    return int(digits[0])


@cache
def _table(name: str) -> NDArray[np.uint8]:
    return next(layout for layout in LAYOUTS if layout.name == name).table()


def _read_image(pair: Pair, has_colours: bool) -> tuple[NDArray[np.uint8], NDArray[Any]]:
    try:
        with Image.open(pair.file) as image, Image.open(pair.labels) as labels:
            rgb = np.asarray(image.convert("RGB"))
            codes = _packed(np.asarray(labels.convert("RGB"))) if has_colours else np.asarray(labels, np.uint32)
    except (UnidentifiedImageError, OSError) as error:
        raise ConfigurationError(f"{pair.file}, {pair.labels}: {error}") from error
    if codes.shape != rgb.shape[:2]:
        sizes = f"{codes.shape[1::-1]} pixels, and the image {rgb.shape[1::-1]}"
        raise ConfigurationError(f"{pair.labels}: labels must have the size of their image; they have {sizes}")
    return rgb, codes


def _read_cloud(pair: Pair, has_colours: bool) -> tuple[NDArray[np.float32], NDArray[Any]]:
    """Read a scan of SemanticKITTI; the upper half of its labels is the instance."""
    del has_colours
    points, labels = np.fromfile(pair.file, np.float32), np.fromfile(pair.labels, np.uint32)
    if points.size != 4 * labels.size:
        raise ConfigurationError(f"{pair.labels}: {labels.size} labels, but {pair.file} has {points.size / 4:g} points")
    return points.reshape(-1, 4), labels & 0xFFFF
