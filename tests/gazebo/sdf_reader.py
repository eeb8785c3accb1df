# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Reads a world file and its meshes back with libraries that we did not write, into triangles in the world."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

F8 = NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """A visual or a collision; ``corners`` (f, 3, 3) [m] are its triangles in the world, None if it is a primitive."""

    model: str
    kind: str
    element: ET.Element
    corners: F8 | None

    @property
    def retro(self) -> int:
        return int(self.element.findtext("laser_retro", "-1"))


def matrix(text: str | None) -> F8:
    """Pose (4, 4) of an SDF <pose>: x y z, then roll, pitch, yaw about fixed axes."""
    values = np.array((text or "0 0 0 0 0 0").split(), np.float64)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", values[3:]).as_matrix()
    pose[:3, 3] = values[:3]
    return pose


def resolve(package: Path, uri: str) -> Path:
    """The file of a model:// URI in a package."""
    assert uri.startswith("model://")
    return package / "models" / uri.removeprefix("model://")


def shapes(package: Path, world_file: str) -> Iterator[Shape]:
    """All visuals and collisions of a world file, models in their order."""
    meshes: dict[Path, F8] = {}
    for model in ET.parse(package / "worlds" / world_file).getroot().iterfind("world/model"):
        world_from_model = matrix(model.findtext("pose"))
        for kind in ("visual", "collision"):
            for element in model.iterfind(f"link/{kind}"):
                pose, mesh = world_from_model @ matrix(element.findtext("pose")), element.find("geometry/mesh")
                corners = None
                if mesh is not None:
                    path = resolve(package, mesh.findtext("uri", ""))
                    if path not in meshes:
                        meshes[path] = triangles(path)
                    scaled = meshes[path] * np.array(mesh.findtext("scale", "1 1 1").split(), np.float64)
                    corners = scaled @ pose[:3, :3].T + pose[:3, 3]
                yield Shape(model.attrib["name"], kind, element, corners)


def triangles(path: Path) -> F8:
    """Corners (f, 3, 3) of a mesh file in its own coordinates."""
    loaded = trimesh.load(path, process=False, force="mesh")
    assert isinstance(loaded, trimesh.Trimesh)
    return np.asarray(loaded.vertices, np.float64)[loaded.faces]
