# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""COCO files read by pycocotools and Pillow: masks are exactly the pixels of a class and an object in the bag."""

import contextlib
import io
import json
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from pycocotools import mask as masks
from pycocotools.coco import COCO
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

from fieldtruth.core.classes import CLASSES, PALETTE, Label
from fieldtruth.exporters import export
from fieldtruth.ontology import LABEL_MAPS

THINGS = {2: "trunk and branch", 3: "treetop", 4: "bush", 5: "rock", 8: "lamp post", 9: "trash bin", 10: "table",
          11: "bench", 12: "post", 13: "cable"}  # fmt: skip
STUFF = {1: "ground", 6: "high grass", 7: "trail", 14: "water", 15: "sky", 16: "robot", 17: "particle"}
SIDES = ("left", "right")
INSTANCES = "/stereo/camera/left/instances"
TAGS = "/stereo/camera/left/tag/img_raw"
PHOTOS = "/stereo/camera/left/real/compressed"


class Truth(NamedTuple):
    """An image in the bag, read by rosbags."""

    label: NDArray[np.uint8]
    instance: NDArray[np.uint16]
    jpeg: bytes
    k: NDArray[np.float64]


class Bag(NamedTuple):
    pictures: dict[str, Truth]
    """By camera and stamp, like ``left/40000000``."""
    names: list[str]
    positions: NDArray[np.float64]
    world_from_base: dict[int, NDArray[np.float64]]
    parents: dict[str, tuple[str, NDArray[np.float64]]]


def matrix(translation: Any, q: Any) -> NDArray[np.float64]:
    result = np.eye(4)
    result[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
    result[:3, 3] = translation.x, translation.y, translation.z
    return result


def read(path: Path) -> Bag:
    parts: dict[str, dict[str, Any]] = defaultdict(dict)
    names: list[str] = []
    positions: Any = None
    poses, parents = {}, {}
    with AnyReader([path]) as reader:
        for connection, stamp, data in reader.messages():
            topic = connection.topic
            if topic == "/clock" or (topic == "/gazebo/model_states" and names):
                continue
            message: Any = reader.deserialize(data, connection.msgtype)
            if topic == "/gazebo/model_states":
                names = message.name
                positions = np.array([[p.position.x, p.position.y, p.position.z] for p in message.pose])
            elif topic == "/ground_truth/odom":
                poses[stamp] = matrix(message.pose.pose.position, message.pose.pose.orientation)
            elif topic == "/tf_static":
                for each in message.transforms:
                    transform = matrix(each.transform.translation, each.transform.rotation)
                    parents[each.child_frame_id] = each.header.frame_id, transform
            elif topic.startswith("/stereo"):
                side, kind = topic.split("/")[3:5]
                parts[f"{side}/{stamp}"][kind] = message
    return Bag({name: truth(kinds) for name, kinds in parts.items()}, names, positions, poses, parents)


def truth(kinds: dict[str, Any]) -> Truth:
    tag, shape = kinds["tag"], (kinds["tag"].height, kinds["tag"].width)
    label = np.zeros(shape, np.uint8)
    for number, rgb in enumerate(PALETTE[1:], start=1):
        label[(tag.data.reshape(*shape, 3) == rgb).all(axis=-1)] = number
    instance = kinds["instances"].data.view("<u2").reshape(shape)
    return Truth(label, instance, bytes(kinds["real"].data), kinds["camera_info"].K.reshape(3, 3))


@pytest.fixture(scope="module")
def bag(brief_run: Path) -> Bag:
    return read(brief_run / "park_1.bag")


@pytest.fixture(scope="module")
def made(brief_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(brief_run, "coco", out=tmp_path_factory.mktemp("coco") / "park_1", workers=2)


@pytest.fixture(scope="module")
def panoptic(made: Path) -> Any:
    return json.loads((made / "panoptic.json").read_text(encoding="utf-8"))


def coco(path: Path) -> COCO:
    with contextlib.redirect_stdout(io.StringIO()):
        return COCO(str(path))


def numbered(name: str) -> bool:
    return name.rsplit("_", 1)[-1].isdigit()


def expected(label: NDArray[np.uint8], instance: NDArray[np.uint16], names: list[str]) -> dict[tuple[int, int], Any]:
    """Masks by category and ``object_id``, which is 0 for stuff and crowds."""
    result: dict[tuple[int, int], Any] = {}
    pairs, owner = np.unique(label.astype(np.int64) << 16 | instance, return_inverse=True)
    for i, pair in enumerate(pairs):
        category, number = divmod(int(pair), 1 << 16)
        key = category, number if category in THINGS and numbered(names[number]) else 0
        result[key] = (owner.reshape(label.shape) == i) | result.get(key, False)
    return result


def image_of(numbers: Path) -> NDArray[np.int64]:
    """Segment ids of a panoptic image, decoded as in COCO's own tools."""
    rgb = np.asarray(Image.open(numbers), np.int64)
    assert rgb.shape[2] == 3
    return rgb[..., 0] + 256 * rgb[..., 1] + 256**2 * rgb[..., 2]


def test_masks_are_the_pixels_of_one_class_and_object(made: Path, bag: Bag) -> None:
    data = coco(made / "instances.json")
    assert {image["file_name"] for image in data.imgs.values()} == {f"{name}.jpg" for name in bag.pictures}
    crowds = 0
    for image_id, image in data.imgs.items():
        picture = bag.pictures[image["file_name"].removesuffix(".jpg")]
        wanted = {key: mask for key, mask in expected(picture.label, picture.instance, bag.names).items()
                  if key[0] in THINGS}  # fmt: skip
        annotations = data.imgToAnns[image_id]
        assert {(a["category_id"], a["object_id"]) for a in annotations} == wanted.keys()
        assert len(annotations) == len(wanted)
        for annotation in annotations:
            mask = wanted[annotation["category_id"], annotation["object_id"]]
            np.testing.assert_array_equal(data.annToMask(annotation), mask)
            rle = data.annToRLE(annotation)
            assert rle["size"] == [*mask.shape]
            assert annotation["area"] == mask.sum() == masks.area(rle)
            assert annotation["bbox"] == masks.toBbox(rle).tolist()
            assert annotation["iscrowd"] == (annotation["object_id"] == 0)
            crowds += annotation["iscrowd"]
    assert crowds > 20
    assert {category["id"]: category["name"] for category in data.dataset["categories"]} == THINGS
    assert {row["id"]: row["name"] for row in data.dataset["objects"]} == dict(enumerate(bag.names))


def test_every_pixel_is_in_one_segment(made: Path, panoptic: Any, bag: Bag) -> None:
    images = {image["id"]: image for image in panoptic["images"]}
    assert [a["image_id"] for a in panoptic["annotations"]] == [*images]
    for annotation in panoptic["annotations"]:
        name = annotation["file_name"].removesuffix(".png")
        assert images[annotation["image_id"]]["file_name"] == f"{name}.jpg"
        picture = bag.pictures[name]
        wanted = expected(picture.label, picture.instance, bag.names)
        numbers = image_of(made / "panoptic" / annotation["file_name"])
        assert len(annotation["segments_info"]) == len(wanted)
        seen = np.zeros(numbers.shape, int)
        for segment in annotation["segments_info"]:
            mask = numbers == segment["id"]
            np.testing.assert_array_equal(mask, wanted[segment["category_id"], segment["object_id"]])
            assert segment["area"] == mask.sum()
            assert segment["bbox"] == masks.toBbox(masks.encode(np.asfortranarray(mask))).tolist()
            crowd = segment["category_id"] in THINGS and not segment["object_id"]
            assert segment["iscrowd"] == crowd
            seen += mask
        assert (seen == 1).all()


def test_categories_are_countable_or_stuff(panoptic: Any) -> None:
    rows = {row["id"]: row for row in panoptic["categories"]}
    assert {number: row["name"] for number, row in rows.items()} == THINGS | STUFF
    assert {number for number, row in rows.items() if row["isthing"]} == THINGS.keys()
    assert all(tuple(row["color"]) == CLASSES[number].rgb for number, row in rows.items())
    assert all(row["supercategory"] for row in rows.values())
    assert panoptic["licenses"][0]["name"] == "CC BY 4.0"
    assert {image["license"] for image in panoptic["images"]} == {panoptic["licenses"][0]["id"]}
    assert (panoptic["info"]["run"], panoptic["info"]["environment"]) == ("park_1", "park")


def test_segment_ids_are_the_same_in_all_images(panoptic: Any) -> None:
    meanings = defaultdict(set)
    for annotation in panoptic["annotations"]:
        for segment in annotation["segments_info"]:
            meanings[segment["id"]].add((segment["category_id"], segment["object_id"], segment["iscrowd"]))
    assert max(map(len, meanings.values())) == 1
    assert len(meanings) > 60


def test_photographs_have_the_bytes_of_the_bag(made: Path, bag: Bag) -> None:
    files = {str(p.relative_to(made / "images").with_suffix("")): p for p in (made / "images").glob("*/*.jpg")}
    assert files.keys() == bag.pictures.keys()
    assert all(path.read_bytes() == bag.pictures[name].jpeg for name, path in files.items())
    sizes = {(image["width"], image["height"]) for image in coco(made / "instances.json").imgs.values()}
    assert sizes == {Image.open(path).size for path in files.values()} == {(160, 92)}
    assert sorted(p.name for p in made.iterdir()) == ["images", "instances.json", "panoptic", "panoptic.json"]


def test_poses_and_calibration_match_the_bag(panoptic: Any, bag: Bag) -> None:
    for image in panoptic["images"]:
        frame = f"{image['camera']}_camera_optical"
        assert (image["frame_id"], image["file_name"]) == (frame, f"{image['camera']}/{image['stamp_ns']}.jpg")
        camera = np.eye(4)
        while frame != "base_link":
            frame, parent_from_child = bag.parents[frame]
            camera = parent_from_child @ camera
        wanted = bag.world_from_base[image["stamp_ns"]] @ camera
        np.testing.assert_allclose(image["world_from_camera"], wanted, atol=1e-12)
        np.testing.assert_array_equal(image["camera_matrix"], bag.pictures[image["file_name"][:-4]].k)
        assert image["distortion"] == [0.0] * 5


def test_object_positions_project_into_their_masks(made: Path, bag: Bag) -> None:
    """The foot of a lamp post, projected with the image's pose and camera matrix, is below the mask's middle."""
    data = coco(made / "instances.json")
    checked = 0
    for annotation in data.loadAnns(data.getAnnIds(catIds=[Label.LAMP_POST], iscrowd=False)):
        image = data.imgs[annotation["image_id"]]
        camera_from_world = np.linalg.inv(image["world_from_camera"])
        foot = camera_from_world[:3, :3] @ bag.positions[annotation["object_id"]] + camera_from_world[:3, 3]
        u, v, w = np.array(image["camera_matrix"]) @ foot
        x, y, width, height = annotation["bbox"]
        if x == 0 or x + width == image["width"] or annotation["area"] < 40:
            continue  # partly outside the image, or too small
        assert x - 1.5 <= u / w <= x + width + 0.5, annotation
        assert v / w >= y + height / 2
        checked += 1
    assert checked > 20


@pytest.mark.parametrize("name", ["rellis", "goose9", "ganav6"])
def test_label_map_relabels(name: str, short: Path, bag: Bag, tmp_path: Path) -> None:
    """RELLIS: trunk and crown of a tree are one segment. GOOSE: vegetation includes high grass, so it is stuff.

    GANav: the sky is in its void class.
    """
    made = export(short, "coco", out=tmp_path / "there", label_map=name, workers=2)
    there = LABEL_MAPS[name]
    data = json.loads((made / "panoptic.json").read_text(encoding="utf-8"))
    rows = {row["id"]: row for row in data["categories"]}
    assert rows.keys() == {int(there.ids[label]) for label in Label} - {0}
    assert all((row["name"], tuple(row["color"])) == there.classes[number] for number, row in rows.items())
    things = {number for number, row in rows.items() if row["isthing"]}
    wanted = {
        "rellis": {"tree", "bush", "rubble", "pole", "object", "building", "fence", "person", "vehicle"},
        "goose9": {"obstacle", "artificial_structures", "human", "vehicle"},
        "ganav6": {"obstacle", "L3 (Bumpy)"},
    }
    assert {rows[number]["name"] for number in things} == wanted[name]
    for annotation in data["annotations"]:
        picture = bag.pictures[annotation["file_name"].removesuffix(".png")]
        numbers = image_of(made / "panoptic" / annotation["file_name"])
        category = there.ids[picture.label]
        single = np.array([numbered(name) for name in bag.names])[picture.instance] & np.isin(category, [*things])
        np.testing.assert_array_equal(numbers >> 16, category)
        np.testing.assert_array_equal(numbers & 0xFFFF, np.where(single, picture.instance, 0))
        assert {segment["id"] for segment in annotation["segments_info"]} == {*np.unique(numbers).tolist()} - {0}
    detection = coco(made / "instances.json")
    assert {category["id"] for category in detection.dataset["categories"]} == things
    assert {annotation["category_id"] for annotation in detection.anns.values()} <= things
