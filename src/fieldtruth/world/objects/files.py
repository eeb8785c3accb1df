# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Files of meshes as parts with what they look like: glTF, OBJ, PLY and STL by trimesh, USD by ``usd``.

A file may name others, such as images: they must lie in its folder or below. An address, and a path that leads out of
the folder, is refused before anything is read.
"""

import json
import struct
from collections.abc import Iterable, Iterator, Mapping
from itertools import takewhile
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
from fieldtruth.world.objects.content import UNREADABLE, FileContent, Look, Part, TextureError, gloss_of, pixels, shares
from fieldtruth.world.objects.usd import named_files, read_usd

MOST_BYTES: Final = 1 << 30
"""Size [byte] of a file of meshes at most; of rasters and laser points only a part is read."""
_MOSAIC: Final = ".vrt"
"""Ending of a raster of other rasters (GDAL)."""
MOST_TRIANGLES: Final = 2_000_000
COLOURS: Final = 8
"""Colours to which those of vertices are reduced: a material has one."""
_GLTF: Final = (".gltf", ".glb")
_COMPRESSED: Final = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu")
"""Extensions of glTF that hide the data of a file."""


def with_named(path: Path) -> list[Path]:
    """Return a file and, if it is one of meshes or a mosaic of rasters, all files that it names and that are there.

    Raises:
        ConfigurationError: it is missing or too large, one of a mesh is not in its folder, or one of a mosaic missing.
    """
    _check(path)
    if path.suffix.lower() == _MOSAIC:
        return [path, *_tiles(path)]
    return [path, *(other for other in _others(path).values() if other.is_file())]


def _check(path: Path) -> None:
    if not path.is_file():
        raise ConfigurationError(f"{path}: there is no such file")
    if path.suffix.lower() in (*FORMATS, _MOSAIC) and path.stat().st_size > MOST_BYTES:
        raise ConfigurationError(f"{path}: must have at most {MOST_BYTES >> 30} GiB")


def _others(path: Path) -> dict[str, Path]:
    """Files that a file names, as it writes them; raises ConfigurationError for one not in its folder or below."""
    folder, found = path.parent.resolve(), {}
    for written in _named(path):
        name = unquote(written) if path.suffix.lower() in _GLTF else written
        if "://" in name or "\0" in name or not (folder / name).resolve().is_relative_to(folder):
            raise ConfigurationError(f"{path}: names {written!r}, which must be a file in its folder or below")
        found[written] = path.parent / name
    return found


def _named(path: Path) -> Iterator[str]:
    """Yield the files that a file names, as it writes them and as trimesh finds them."""
    match path.suffix.lower():
        case ending if ending in _GLTF:
            document = _gltf(path)
            for entry in (*document.get("buffers", ()), *document.get("images", ())):
                uri = str(entry.get("uri", "base64,"))
                if "base64," not in uri:
                    yield uri
        case ".obj":
            text = _text(path).replace("\r\n", "\n").replace("\\\n", "")
            library = text.partition("mtllib")[2].partition("\n")[0].strip()
            if library:
                yield library
                if _is_below(path.parent, library):
                    lines = _text(path.parent / library).splitlines()
                    yield from _after("map_kd", (line for line in lines if line.lower().split()[:1] == ["map_kd"]))
        case ".ply":
            yield from _after("texturefile", _header(path))
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


def _text(path: Path) -> str:
    from trimesh.util import decode_text

    try:
        return str(decode_text(path.read_bytes()))
    except (ImportError, LookupError) as error:  # it guesses what is no UTF-8
        raise ConfigurationError(f"{path}: must be text in UTF-8") from error


def _header(path: Path) -> Iterator[str]:
    """Yield the lines of a PLY file's header."""
    with path.open("rb") as file:
        lines = (line.decode("utf-8", errors="replace") for line in file)
        yield from takewhile(lambda line: "end_header" not in line.split(), lines)


def _after(key: str, lines: Iterable[str]) -> Iterator[str]:
    """Yield what follows a key, in small or large letters, in each line that has it."""
    for line in lines:
        name = line[line.lower().index(key) + len(key) :].strip() if key in line.lower() else ""
        if name:
            yield name


def _gltf(path: Path) -> dict[str, Any]:
    """Read the document of a glTF file."""
    try:
        with path.open("rb") as file:
            size = -1
            if path.suffix.lower() == ".glb":
                magic, _, _, size, kind = struct.unpack("<4sIII4s", file.read(20))
                if magic != b"glTF" or kind != b"JSON":
                    raise ValueError("it does not begin as a binary glTF file")
            document = json.loads(file.read(size))
        if not isinstance(document, dict):
            raise ValueError("it is not a JSON object")
        for key, kind in (("buffers", dict), ("images", dict), ("extensionsRequired", str)):
            rows = document.get(key, [])
            if not isinstance(rows, list) or not all(isinstance(row, kind) for row in rows):
                raise ValueError(f"{key} is not a list of {'names' if kind is str else 'JSON objects'}")
    except (ValueError, RecursionError, struct.error) as error:
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
    _check(path)
    others = _others(path)
    if looks:
        _check_looks(path, others)
    try:
        content = read_usd(path) if path.suffix.lower().startswith(".usd") else _read_trimesh(path, others)
    except TextureError as error:
        raise ConfigurationError(f"{path}: {error}") from error
    count = sum(len(part.faces) for part in content.parts)
    if count == 0:
        raise ConfigurationError(f"{path}: must have triangles, got none")
    if count > MOST_TRIANGLES:
        raise ConfigurationError(f"{path}: must have at most {MOST_TRIANGLES:,} triangles, got {count:,}; simplify it")
    return content


def _check_looks(path: Path, others: Mapping[str, Path]) -> None:
    """Refuse files that are missing, and images that cannot be read, of which trimesh says nothing."""
    ours = "choose a material of ours"
    for written, other in others.items():
        if written.startswith("-") and path.suffix.lower() == ".obj" and not other.is_file():
            raise ConfigurationError(f"{path}: map_Kd must be the name of an image without options, got {written!r}")
        if not other.is_file():
            raise ConfigurationError(f"{path}: {written!r}, which it names, is missing; or {ours}")
        if other.suffix.lower() in Image.registered_extensions():
            try:
                with Image.open(other):
                    pass
            except UNREADABLE as error:
                raise ConfigurationError(f"{path}: {written!r}, which it names, is no image; or {ours}") from error


def _read_trimesh(path: Path, others: Mapping[str, Path]) -> FileContent:
    import trimesh

    named = {written: other.read_bytes() for written, other in others.items() if other.is_file()}
    try:
        scene = trimesh.load_scene(path, resolver=named, process=False)  # it reads no other files
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
    up = "y" if path.suffix.lower() in (*_GLTF, ".obj") else "z"
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
