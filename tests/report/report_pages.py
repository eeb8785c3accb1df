# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a run, made once and read by many tests, and bags with something changed or taken away."""

import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import html5lib
import numpy as np
import pytest
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader, Writer

from fieldtruth.bag.topics import TOPICS
from fieldtruth.report.page import aerial_view, write_report

TAGS = ["/stereo/camera/left/tag/img_raw", "/stereo/camera/right/tag/img_raw"]
TYPES = {topic.name: topic.msgtype for topic in TOPICS}
POINTS, ODOMETRY = "/os1_cloud_node/points", "/ground_truth/odom"

Messages = dict[str, list[Any]]
"""By topic: stamp in the bag [ns] and message."""


class Page:
    """A page, read by html5lib, which is strict about HTML's grammar."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.text = path.read_text(encoding="utf-8")
        short = re.sub(r"base64,[A-Za-z0-9+/=]+", "base64,AA==", self.text)
        short = re.sub(r'(id="cloud-data">)[^<]*', r"\1", short)
        self.root: Element = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(short)

    def one(self, path: str) -> Element:
        """The only element at a path of ElementTree's."""
        (found,) = self.root.findall(path)
        return found

    def words(self, path: str) -> str:
        """What is written there, with single blanks."""
        return words(self.one(path))

    def rows(self, path: str) -> list[list[str]]:
        """Cells of a table's body."""
        return [[words(cell) for cell in row] for row in self.root.findall(f"{path}/tbody/tr")]

    def terms(self, path: str) -> dict[str, str]:
        """Texts of a list by their terms."""
        return {words(row[0]): words(row[1]) for row in self.root.findall(f"{path}/div")}

    def data(self, name: str) -> Any:
        """What the scripts are given."""
        return json.loads(self.words(f".//script[@id='{name}']"))

    def images(self, kind: str) -> list[str]:
        """Base64 of all images of a kind, ``image/png`` say, in the page's order."""
        return re.findall(rf"data:{kind};base64,([A-Za-z0-9+/=]+)", self.text)


_PAGES: dict[Path, Page] = {}


def page_of(run: Path, factory: pytest.TempPathFactory) -> Page:
    """Page of a run, with a small photograph from above, because a large one takes seconds; made once."""
    if run not in _PAGES:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(aerial_view, "WIDTH", 600)
            _PAGES[run] = Page(write_report(run, out=factory.mktemp("page") / "page.html"))
    return _PAGES[run]


@cache
def messages_of(run: Path) -> Messages:
    """Some topics of a run, as the rosbags library reads them."""
    wanted = {*TAGS, POINTS, ODOMETRY, "/imu/data", "/stereo/camera/left/real/compressed"}
    found: Messages = {}
    with AnyReader([run / "park_1.bag"]) as reader:
        for connection, stamp, data in reader.messages([c for c in reader.connections if c.topic in wanted]):
            found.setdefault(connection.topic, []).append((stamp, reader.deserialize(data, connection.msgtype)))
    return found


def way(messages: Messages) -> NDArray[np.float64]:
    """True positions (n, 3) [m]."""
    positions = [message.pose.pose.position for _, message in messages[ODOMETRY]]
    return np.array([(p.x, p.y, p.z) for p in positions])


def pairs(points: str) -> NDArray[np.float64]:
    """Coordinates (n, 2) of an SVG's points."""
    return np.array([[float(v) for v in point.split(",")] for point in points.split()])


_PLAIN = str.maketrans({"\N{RIGHT SINGLE QUOTATION MARK}": "'", "\N{MULTIPLICATION SIGN}": "x", "\N{MINUS SIGN}": "-"})


def words(element: Element) -> str:
    """All text in an element, with single blanks and plain signs."""
    return " ".join("".join(element.itertext()).translate(_PLAIN).split())


def changed(bag: Path, path: Path, change: Callable[[str, int, bytes], tuple[str, int, bytes] | None]) -> Path:
    """Copy a bag; ``change`` gives topic, stamp and bytes of each message, or None where there shall be none."""
    made: dict[str, Any] = {}
    with Reader(bag) as reader, Writer(path) as writer:
        for old, stamp_ns, data in reader.messages():
            new = change(old.topic, stamp_ns, bytes(data))
            if new is None:
                continue
            if new[0] not in made:
                made[new[0]] = writer.add_connection(new[0], old.msgtype, msgdef=old.msgdef.data, md5sum=old.digest)
            writer.write(made[new[0]], new[1], new[2])
    return path


def only(bag: Path, path: Path, *topics: str) -> Path:
    """Copy some topics of a bag."""
    return changed(bag, path, lambda topic, stamp, data: (topic, stamp, data) if topic in topics else None)


def longer(bag: Path, path: Path, times: int) -> Path:
    """Repeat a bag, one time after the other; the stamps in the bag go on, those of the headers do not."""
    made: dict[str, Any] = {}
    with Reader(bag) as reader, Writer(path) as writer:
        for number in range(times):
            for old, stamp_ns, data in reader.messages():
                if old.topic not in made:
                    made[old.topic] = writer.add_connection(
                        old.topic, old.msgtype, msgdef=old.msgdef.data, md5sum=old.digest
                    )
                writer.write(made[old.topic], stamp_ns + number * 2 * 10**9, bytes(data))
    return path
