# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Files of meshes as parts with what they look like: glTF, OBJ, PLY and STL by trimesh, USD by ``usd``.

A file may name others, such as images: they must lie in its folder or below. An address, and a path that leads out of
the folder, is refused before anything is read.
"""

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.kernels.textures import linear_from_srgb
from fieldtruth.world.objects.config import FORMATS
from fieldtruth.world.objects.content import FileContent, Look, Part, gloss_of, pixels, shares
from fieldtruth.world.objects.usd import named_files, read_usd

MOST_BYTES: Final = 1 << 30
"""Size [byte] of a file of meshes at most; of rasters and laser points only a part is read."""
_MOSAIC: Final = ".vrt"
"""Ending of a raster of other rasters (GDAL)."""
MOST_TRIANGLES: Final = 2_000_000
COLOURS: Final = 8
"""Colours to which those of vertices are reduced: a material has one."""
_COMPRESSED: Final = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu")
"""Extensions of glTF that hide the data of a file."""


def with_named(path: Path) -> list[Path]:
    """Return a file and, if it is one of meshes or a mosaic of rasters, all files that it names and that are there.

    Raises:
        ConfigurationError: it is missing or too large, one of a mesh is not in its folder, or one of a mosaic missing.
    """
    if not path.is_file():
        raise ConfigurationError(f"{path}: there is no such file")
    if path.suffix.lower() in (*FORMATS, _MOSAIC) and path.stat().st_size > MOST_BYTES:
        raise ConfigurationError(f"{path}: must have at most {MOST_BYTES >> 30} GiB")
    if path.suffix.lower() == _MOSAIC:
        return [path, *_tiles(path)]
    others = [(path.parent / unquote(name)) for name in _inside(path)]
    return [path, *(other for other in others if other.is_file())]


def _inside(path: Path) -> Iterator[str]:
    """Yield the files that a file names; raises ConfigurationError for one that is not in its folder or below."""
    folder = path.parent.resolve()
    for name in _named(path):
        if "://" in name or not (folder / unquote(name)).resolve().is_relative_to(folder):
            raise ConfigurationError(f"{path}: names {name!r}, which must be a file in its folder or below")
        yield name


def _named(path: Path) -> Iterator[str]:
    """Yield the files that a file names, as it writes them."""
    match path.suffix.lower():
        case ".gltf" | ".glb":
            document = _gltf(path)
            for entry in (*document.get("buffers", ()), *document.get("images", ())):
                uri = str(entry.get("uri", "data:"))
                if not uri.startswith("data:"):
                    yield uri
        case ".obj":
            for library in _values(path, "mtllib"):
                yield library
                if _is_below(path.parent, library):
                    yield from _values(path.parent / library, "map_Kd")
        case ".ply":
            with path.open("rb") as file:
                header = file.read(1 << 16).partition(b"end_header")[0].decode("latin-1")
            yield from (line.split(None, 2)[2].strip() for line in header.splitlines() if "TextureFile " in line)
        case ".usd" | ".usda" | ".usdc" | ".usdz":
            yield from named_files(path)


def _tiles(path: Path) -> Iterator[Path]:
    """Yield the rasters of a mosaic: all must be there and none a mosaic itself, so that a change of one is noticed."""
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise ConfigurationError(f"{path}: not a mosaic of rasters that GDAL reads: {error}") from error
    for each in root.iter():
        if each.tag in ("SourceFilename", "SourceDataset"):
            name = (each.text or "").strip()
            found = (path.parent if each.get("relativeToVRT") == "1" else Path()).absolute() / name
            if not found.is_file() or found.suffix.lower() == _MOSAIC:
                raise ConfigurationError(f"{path}: names {name!r}, which must be a file, and no {_MOSAIC}")
            yield found


def _is_below(folder: Path, name: str) -> bool:
    other = (folder / name).resolve()
    return other.is_relative_to(folder.resolve()) and other.is_file()


def _values(path: Path, key: str) -> Iterator[str]:
    """Yield what follows a key in the lines of an OBJ file or its library; options with their numbers are skipped."""
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            word, _, rest = line.strip().partition(" ")
            if word == key and rest:
                yield rest.split()[-1] if rest.startswith("-") else rest.strip()


def _gltf(path: Path) -> dict[str, Any]:
    """Read the document of a glTF file."""
    data = path.read_bytes()
    try:
        if path.suffix.lower() == ".glb":
            magic, _, _, size, kind = struct.unpack_from("<4sIII4s", data)
            if magic != b"glTF" or kind != b"JSON":
                raise ValueError("it does not begin as a binary glTF file")
            data = data[20 : 20 + size]
        document = json.loads(data)
        if not isinstance(document, dict):
            raise ValueError("it is not a JSON object")
    except (ValueError, struct.error) as error:
        raise ConfigurationError(f"{path}: cannot be read as glTF: {error}") from error
    needs = [name for name in document.get("extensionsRequired", ()) if name in _COMPRESSED]
    if needs:
        raise ConfigurationError(f"{path}: needs {needs[0]}; export it without compression")
    return document


def read_file(path: Path, *, looks: bool = True) -> FileContent:
    """Read the triangles of a file; without ``looks``, what these need may be missing.

    Raises:
        ModuleNotFoundError: the library that reads it is not installed.
        ConfigurationError: a file that cannot be read, has no triangles or too many, or names one that is not allowed.
    """
    with_named(path)
    missing = next((name for name in _inside(path) if not (path.parent / unquote(name)).is_file()), None)
    if missing is not None and looks:
        raise ConfigurationError(f"{path}: {missing!r}, which it names, is missing; or choose a material of ours")
    content = read_usd(path) if path.suffix.lower().startswith(".usd") else _read_trimesh(path)
    count = sum(len(part.faces) for part in content.parts)
    if count == 0:
        raise ConfigurationError(f"{path}: must have triangles, got none")
    if count > MOST_TRIANGLES:
        raise ConfigurationError(f"{path}: must have at most {MOST_TRIANGLES:,} triangles, got {count:,}; simplify it")
    return content


def _read_trimesh(path: Path) -> FileContent:
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False)
    except Exception as error:  # whatever a reader raises on a damaged file
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise ConfigurationError(f"{path}: cannot be read as {path.suffix[1:].upper()}: {reason}") from error
    notes: list[str] = []
    parts: list[Part] = []
    for node in sorted(scene.graph.nodes_geometry):
        pose, name = scene.graph[node]
        mesh = scene.geometry[name]
        if len(getattr(mesh, "faces", ())):
            vertices = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
            faces = mesh.faces[:, ::-1] if np.linalg.det(pose[:3, :3]) < 0 else mesh.faces
            parts += _by_look(str(node), vertices, np.asarray(faces, np.int64), mesh.visual, notes)
        else:
            notes.append(f"{node} has no triangles and is left out")
    up = "y" if path.suffix.lower() in (".glb", ".gltf", ".obj") else "z"
    return FileContent(parts, None, up, notes)


def _by_look(name: str, vertices: Array, faces: NDArray[np.int64], visual: Any, notes: list[str]) -> Iterator[Part]:
    """Yield the triangles of a mesh of trimesh by look: one, or one for each of a few colours."""
    if visual.kind == "texture":
        uv = None if visual.uv is None or len(visual.uv) != len(vertices) else np.asarray(visual.uv, np.float64)
        yield Part(name, vertices, faces, uv, _look(visual.material, notes))
    elif visual.kind in ("vertex", "face"):
        rgb = np.asarray(visual.face_colors, np.uint8)[None, :, :3]
        few = Image.fromarray(rgb).quantize(COLOURS, dither=Image.Dither.NONE)
        row, palette = np.asarray(few)[0], np.array(few.getpalette("RGB"), np.float64).reshape(-1, 3)
        for k in np.unique(row).tolist():
            yield Part(
                name, vertices, faces[row == k], None, Look(f"colour_{k}", shares(linear_from_srgb(palette[k] / 255.0)))
            )
    else:
        yield Part(name, vertices, faces, None, Look())


def _look(material: Any, notes: list[str]) -> Look:
    """Look of a material of trimesh."""
    name = str(getattr(material, "name", "") or "")
    factor = getattr(material, "baseColorFactor", getattr(material, "diffuse", None))
    rgb = (1.0, 1.0, 1.0) if factor is None else shares(factor)
    image = getattr(material, "baseColorTexture", getattr(material, "image", None))
    rough = getattr(material, "roughnessFactor", None)
    return Look(name, rgb, pixels(image, name, notes), 0.0 if rough is None else gloss_of(float(rough)))
