# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Pages of runs, parsed, and bags with changed or removed messages."""

import json
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import html5lib
import numpy as np
import pytest
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader, Writer

from fieldtruth.bag.topics import PAPER_TOPICS
from fieldtruth.report.page import map as page_map
from fieldtruth.report.page import write_report

TAGS = ["/stereo/camera/left/tag/img_raw", "/stereo/camera/right/tag/img_raw"]
TYPES = {topic.name: topic.msgtype for topic in PAPER_TOPICS}
POINTS, ODOMETRY = "/os1_cloud_node/points", "/ground_truth/odom"

Messages = dict[str, list[Any]]
"""Stamp in the bag [ns] and message by topic."""


class Page:
    """A page, parsed by html5lib in strict mode."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.text = path.read_text(encoding="utf-8")
        short = re.sub(r"base64,[A-Za-z0-9+/=]+", "base64,AA==", self.text)
        short = re.sub(r'(id="cloud-data">)[^<]*', r"\1", short)
        self.root: Element = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(short)

    def one(self, path: str) -> Element:
        """The only element at an ElementTree path."""
        (found,) = self.root.findall(path)
        return found

    def words(self, path: str) -> str:
        """Text of the only element at a path, with single blanks."""
        return words(self.one(path))

    def rows(self, path: str) -> list[list[str]]:
        """Cells of the body of a table."""
        return [[words(cell) for cell in row] for row in self.root.findall(f"{path}/tbody/tr")]

    def terms(self, path: str) -> dict[str, str]:
        """Texts of a definition list by term."""
        return {words(row[0]): words(row[1]) for row in self.root.findall(f"{path}/div")}

    def data(self, name: str) -> Any:
        """Data for the scripts."""
        return json.loads(self.words(f".//script[@id='{name}']"))

    def images(self, kind: str) -> list[str]:
        """Base64 of all images of a media type, in the order of the page."""
        return re.findall(rf"data:{kind};base64,([A-Za-z0-9+/=]+)", self.text)


def write_page(run: Path, path: Path) -> Path:
    """Write the page of a run with a small aerial view, because a large one takes seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page_map, "WIDTH", 600)
        return write_report(run, out=path)


def page_of(run: Path, path: Path) -> Page:
    """The page of a run with a small aerial view."""
    return Page(write_page(run, path))


def read_messages(bag: Path) -> Messages:
    """Messages of some topics, read by the rosbags library."""
    wanted = {*TAGS, POINTS, ODOMETRY, "/imu/data", "/stereo/camera/left/real/compressed"}
    found: Messages = {}
    with AnyReader([bag]) as reader:
        for connection, stamp, data in reader.messages([c for c in reader.connections if c.topic in wanted]):
            found.setdefault(connection.topic, []).append((stamp, reader.deserialize(data, connection.msgtype)))
    return found


def positions_of(messages: Messages) -> NDArray[np.float64]:
    """True positions (n, 3) [m]."""
    positions = [message.pose.pose.position for _, message in messages[ODOMETRY]]
    return np.array([(p.x, p.y, p.z) for p in positions])


def pairs(points: str) -> NDArray[np.float64]:
    """Coordinates (n, 2) in the points attribute of an SVG element."""
    return np.array([[float(v) for v in point.split(",")] for point in points.split()])


_PLAIN = str.maketrans({"\N{RIGHT SINGLE QUOTATION MARK}": "'", "\N{MULTIPLICATION SIGN}": "x", "\N{MINUS SIGN}": "-"})


def words(element: Element) -> str:
    """Text of an element with single blanks and ASCII signs."""
    return " ".join("".join(element.itertext()).translate(_PLAIN).split())


def changed(bag: Path, path: Path, change: Callable[[str, int, bytes], tuple[str, int, bytes] | None]) -> Path:
    """Copy a bag; ``change`` returns topic, stamp and bytes of each message, or None to drop it."""
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
    """Repeat the messages of a bag, which must have headers, with later stamps."""
    made: dict[str, Any] = {}
    with Reader(bag) as reader, Writer(path) as writer:
        for number in range(times):
            for old, stamp_ns, data in reader.messages():
                if old.topic not in made:
                    made[old.topic] = writer.add_connection(
                        old.topic, old.msgtype, msgdef=old.msgdef.data, md5sum=old.digest
                    )
                seconds, rest = struct.unpack_from("<2L", data, 4)
                moved = bytes(data[:4]) + struct.pack("<2L", seconds + number * 2, rest) + bytes(data[12:])
                writer.write(made[old.topic], stamp_ns + number * 2 * 10**9, moved)
    return path
