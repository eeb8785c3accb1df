# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Entries of the key ``objects`` of a layout: a file, its class, where its object stands, what a robot touches."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from fieldtruth.experiment.fields import Frozen, Integer, LocatedError, Number, Positive

FORMATS: Final = (".glb", ".gltf", ".obj", ".ply", ".stl", ".usd", ".usda", ".usdc", ".usdz")
UNITS: Final[Mapping[str, float]] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Units of length [m]."""
_WORD: Final = "[A-Za-z0-9][A-Za-z0-9_-]{0,63}"
Share = Annotated[Number, Field(ge=0, le=1)]


def _listed(value: Any) -> Any:
    """Return a list of poses, which one pose is as well."""
    single = isinstance(value, list | tuple) and value and not isinstance(value[0], list | tuple)
    return [value] if single else value


_Numbers = Annotated[tuple[Number, ...], Field(min_length=2, max_length=4)]


class ScatterConfig(Frozen):
    """A rule by which copies are scattered; none overlaps another object or is in a corridor."""

    count: Annotated[Integer, Field(ge=1, le=100_000)] | None = None
    per_hectare: Annotated[Number, Field(gt=0, le=100_000)] | None = None
    spacing: Annotated[Number, Field(ge=0, le=1000)] = 0.0
    """Distance [m] between any two; it eases to half where space is scarce."""
    surface: Annotated[tuple[str, ...], Field(description="a list of materials of the ground, or trail")] = ()
    """Where they stand; empty for everywhere off the trails."""
    slope: Annotated[Number, Field(gt=0, le=90)] = 25.0
    """Steepest ground [deg]."""
    cluster: Annotated[Integer, Field(ge=1, le=1000)] = 1
    """Copies in a cluster, on average."""
    cluster_radius: Positive = 3.0
    """Standard deviation [m] of the distance along x and y from the middle of a cluster."""
    scales: Annotated[tuple[Positive, Positive], Field(description="[smallest, largest], each above 0")] = (1.0, 1.0)

    @model_validator(mode="after")
    def _one_number(self) -> Self:
        if (self.count is None) == (self.per_hectare is None):
            raise ValueError("either count or per_hectare is required")
        if self.scales[0] > self.scales[1]:
            raise LocatedError(f"must be [smallest, largest], got {list(self.scales)}", ("scales",))
        return self


class ObjectConfig(Frozen):
    """An object from a file. See docs/objects.md."""

    file: Annotated[str, Field(min_length=1, description=f"the path of a file: {', '.join(FORMATS)}")]
    label: Annotated[str | Mapping[str, str], Field(description="a class, or classes by name of a part or material")]
    """Class of all triangles, or by name of a node or a material of the file, in which ``*`` stands for any text."""
    name: Annotated[str, Field(pattern=rf"^({_WORD})?$", description="a word of letters, digits, - and _")] = ""
    """Of its copies, with a number; by default that of the file."""
    pose: Annotated[
        tuple[_Numbers, ...], BeforeValidator(_listed),
        Field(description="[x, y], [x, y, yaw], [x, y, yaw, height], or a list of these"),
    ] = ()  # fmt: skip
    """Positions [m] in the world, yaw [deg] from x towards y, and height [m] above the ground."""
    degrees: Annotated[
        tuple[_Numbers, ...], BeforeValidator(_listed),
        Field(description="[latitude, longitude], with yaw and height if they are not 0, or a list of these"),
    ] = ()  # fmt: skip
    """The same with latitude and longitude [deg]."""
    scatter: ScatterConfig | None = None
    unit: Annotated[Literal["m", "cm", "mm", "in", "ft"], Field(description="m, cm, mm, in or ft")] | None = None
    """Of the file's numbers; by default what USD says, and metres."""
    up: Literal["y", "z"] | None = None
    """Axis of the file that points up; by default what USD says, y for glTF and OBJ, z for PLY and STL."""
    scale: Positive = 1.0
    collider: Literal["convex_hull", "mesh", "box", "none"] = "convex_hull"
    material: str = ""
    """One of ours, instead of the file's."""
    reflectance: Share | None = None
    """Of a LiDAR's light; by default that of the class."""

    @model_validator(mode="after")
    def _placed_once(self) -> Self:
        if bool(self.pose or self.degrees) == (self.scatter is not None):
            raise ValueError("a place is required: pose, degrees or scatter, and scatter alone")
        if self.path.suffix.lower() not in FORMATS:
            raise LocatedError(f"must end in {', '.join(FORMATS)}, got {self.file!r}", ("file",))
        if not re.fullmatch(_WORD, self.title):
            raise LocatedError(f"is required, as that of the file has other characters: {self.path.stem!r}", ("name",))
        return self

    @property
    def path(self) -> Path:
        """Path of the file."""
        return Path(self.file).expanduser()

    @property
    def title(self) -> str:
        """Name of its copies."""
        return self.name or self.path.stem

    @property
    def mesh(self) -> str:
        """Name of its mesh, and its kind: no environment gives it to one of its own, nor a meaning."""
        return f"own_{self.title}"
