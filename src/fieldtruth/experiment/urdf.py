# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Poses of frames from the fixed joints of a URDF (ROS's description of a robot), for sensors that name a frame."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple, NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import nearest_first
from fieldtruth.experiment.fields import LocatedError, Mount, shortened

KEY: Final = "urdf"
MAX_FILE_SIZE: Final = 4 << 20  # [byte]; descriptions of whole arms and humanoids have less than 1 MiB
_BASE: Final = "base_link"
_NEAREST: Final = 8
_DIGITS: Final = 12  # after the point, of [m] and [deg]
_SAME: Final = 1e-6  # [m], and of the cosines: most files have so many digits


class _Joint(NamedTuple):
    name: str
    kind: str
    parent: str
    parent_from_child: Array


class Urdf:
    """The joints of a URDF by their child links."""

    def __init__(self, path: Path) -> None:
        """Read a file.

        Raises:
            LocatedError: it cannot be read, or is not a URDF; the position is that of the key ``urdf``.
        """
        self.path = path
        root = _parsed(path)
        self.links = [link.get("name", "") for link in root.findall("link")]
        if root.tag != "robot" or _BASE not in self.links:
            what = f"has no link {_BASE!r}; nearest first: {', '.join(self._nearest(_BASE))}" if self.links else ""
            _fail(path, what if root.tag == "robot" and what else "is not a URDF: it must have <robot> with links")
        self._joints: dict[str, _Joint] = {}
        for element in root.findall("joint"):
            child = _attribute(element.find("child"), "link")
            if child in self._joints:
                _fail(path, f"has two joints with the child {child!r}")
            self._joints[child] = self._joint(element)

    def mount(self, frame: str, at: tuple[str | int, ...]) -> Mount:
        """Pose of a frame in base_link.

        Raises:
            LocatedError: unknown frame, or one that a joint moves; ``at`` is the position of the key that names it.
        """
        if frame not in self.links:
            known = ", ".join(self._nearest(frame))
            raise LocatedError(f"{frame!r} is not a link of {self.path}; nearest first: {known}", at)
        own, base = self._to_root(frame), self._to_root(_BASE)
        while own and base and own[-1] is base[-1]:
            del own[-1], base[-1]
        if (own[-1].parent if own else frame) != (base[-1].parent if base else _BASE):
            raise LocatedError(f"{frame!r} is not connected with {_BASE} in {self.path}", at)
        for joint in (*own, *base):
            if joint.kind != "fixed":
                which = f"joint {joint.name!r} of {self.path} is {shortened(joint.kind)}, not fixed"
                raise LocatedError(f"{frame!r} moves against {_BASE}: {which}; give a mount instead", at)
        return _mount(transforms.inverse(_product(base)) @ _product(own))

    def _nearest(self, name: str) -> list[str]:
        return [shortened(link).strip("'\"") for link in nearest_first(name, self.links)[:_NEAREST]]

    def _to_root(self, link: str) -> list[_Joint]:
        chain: list[_Joint] = []
        while link in self._joints:
            chain.append(self._joints[link])
            link = chain[-1].parent
            if len(chain) > len(self._joints):
                _fail(self.path, f"has a cycle of joints at {link!r}")
        return chain

    def _joint(self, element: Element) -> _Joint:
        name, origin = element.get("name", ""), element.find("origin")
        xyz, rpy = (self._numbers(name, origin, key) for key in ("xyz", "rpy"))
        pose = transforms.pose(xyz, np.degrees(rpy).tolist())
        return _Joint(name, element.get("type", ""), _attribute(element.find("parent"), "link"), pose)

    def _numbers(self, joint: str, origin: Element | None, key: str) -> list[float]:
        text = _attribute(origin, key) or "0 0 0"
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != 3 or not np.isfinite(values).all():
            _fail(self.path, f"joint {joint!r}: {key} of its origin must be three numbers, got {shortened(text)}")
        return values


def with_urdf_mounts(given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the values of a rig without ``urdf``: sensors with a frame and no mount have that of the file's frame.

    Raises:
        LocatedError: as ``Urdf`` and ``Urdf.mount``, or a pair whose frames are not beside each other.
    """
    if KEY not in given:
        return given
    path = given[KEY]
    if not isinstance(path, str) or not path:
        raise LocatedError(f"must be the path of a URDF, got {shortened(path)}", (KEY,))
    urdf = Urdf(Path(path))
    values: dict[str, Any] = {}
    for key, value in given.items():
        if key == "sensors" and isinstance(value, list | tuple):
            values[key] = [_mounted(urdf, item, (key, i)) for i, item in enumerate(value)]
        elif key != KEY:
            values[key] = _mounted(urdf, value, (key,))
    return values


def _mounted(urdf: Urdf, item: Any, at: tuple[str | int, ...]) -> Any:
    if not isinstance(item, Mapping) or not {"mount", "left", "right"}.isdisjoint(item):
        return item
    frame, at = item.get("frame"), (*at, "frame")
    if not isinstance(frame, str):
        return item
    if "{side}" not in frame:
        return {**item, "mount": urdf.mount(frame, at)}
    left, right = (urdf.mount(frame.replace("{side}", side), at) for side in ("left", "right"))
    left_from_right = transforms.inverse(left.base_from_sensor) @ right.base_from_sensor
    x, y, z = left_from_right[:3, 3].tolist()
    if not np.allclose(left_from_right[:3, :3], np.eye(3), atol=_SAME) or max(abs(x), abs(z)) > _SAME or y >= 0:
        raise LocatedError(
            f"{frame!r}: left and right must have the same orientation in {urdf.path}, with right on the negative y "
            "axis of left",
            at,
        )
    middle = np.round(np.add(left.xyz, right.xyz) / 2, _DIGITS) + 0.0
    baseline = round(-y, _DIGITS)
    if abs(item.get("baseline", baseline) - baseline) > _SAME:
        raise LocatedError(f"must be {baseline!r}, as in {urdf.path}, got {item['baseline']!r}", (*at[:-1], "baseline"))
    return {**item, "baseline": baseline, "mount": Mount(xyz=tuple(middle.tolist()), rpy_deg=left.rpy_deg)}


def _product(chain: list[_Joint]) -> Array:
    """Root from the first link, (4, 4)."""
    result: Array = np.eye(4)
    for joint in chain:
        result = joint.parent_from_child @ result
    return result


def _mount(base_from_frame: Array) -> Mount:
    angles = transforms.rpy_deg_from_rotation(base_from_frame[:3, :3])
    xyz, rpy = (np.round(values, _DIGITS) + 0.0 for values in (base_from_frame[:3, 3], angles))
    return Mount(xyz=tuple(xyz.tolist()), rpy_deg=tuple(rpy.tolist()))


def _parsed(path: Path) -> Element:
    """Read XML without a document type, so without entities."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_FILE_SIZE + 1)
    except (OSError, ValueError) as error:  # ValueError: a path with a null byte
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise LocatedError(f"cannot read {shortened(str(path))}: {reason}", (KEY,)) from error
    if len(data) > MAX_FILE_SIZE:
        _fail(path, f"is too large for a URDF: more than {MAX_FILE_SIZE >> 20} MiB")
    builder, parser = TreeBuilder(), expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        if tag.startswith("xacro:"):
            _fail(path, f"needs xacro first; run: xacro {path} > robot.urdf")
        builder.start(tag, attributes)

    def refuse(*_: object) -> None:
        _fail(path, "has a document type, which a URDF does not need")

    parser.StartElementHandler, parser.EndElementHandler = start, builder.end
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except LocatedError:
        raise
    except (
        expat.ExpatError,
        LookupError,
        ValueError,
    ) as error:  # the latter two: an encoding that Python does not have
        raise LocatedError(f"{path} is not XML: {error}", (KEY,)) from error
    return builder.close()


def _attribute(element: Element | None, name: str) -> str:
    return "" if element is None else element.get(name, "")


def _fail(path: Path, what: str) -> NoReturn:
    raise LocatedError(f"{path} {what}", (KEY,))
