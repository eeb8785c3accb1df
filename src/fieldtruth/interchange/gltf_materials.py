# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Materials and textures of a glTF scene.

A tint of glTF is at most 1, ours may brighten. So a texture is stored as bright as its brightest use, and each material
has a factor of at most 1. Tints of objects are rounded to ``STEPS`` of brightness, each a material of its own, because
glTF has no colour per node, and tools ignore extensions that add one.
"""

from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.interchange.glb import Glb
from fieldtruth.interchange.images import encode_image, roughness, tinted
from fieldtruth.world.model import World

STEPS: Final = tuple(2.0 ** (k / 4) for k in range(-2, 3))
"""Steps of brightness, 19 % apart: a rounded tint is at most 9 % off within their range."""
NEUTRAL: Final = STEPS.index(1.0)
_LUMINANCE: Final = (0.2126, 0.7152, 0.0722)
_REPEAT, _CLAMP, _LINEAR, _MIPMAPS = 10497, 33071, 9729, 9987

Look = tuple[str, int]
"""A material's name and a step of brightness."""


def nearest_step(tints: ArrayLike) -> NDArray[np.intp]:
    """Index (n,) into ``STEPS`` whose brightness is nearest to that of linear tints (n, 3)."""
    brightness = np.log2(np.maximum(np.asarray(tints, np.float64) @ _LUMINANCE, 1e-6))
    return np.asarray(np.abs(brightness[:, None] - np.log2(STEPS)).argmin(axis=1))


class Materials:
    """The materials of a scene, written once each."""

    def __init__(self, world: World, glb: Glb, looks: Iterable[Look]) -> None:
        """``looks`` are all that will be used."""
        self._world, self._glb = world, glb
        self._gain: dict[str, float] = {}
        for name, step in looks:
            material = world.materials[name]
            brightest = max(material.tint) * STEPS[step]
            self._gain[material.texture] = max(1.0, brightest, self._gain.get(material.texture, 1.0))
        self._textures: dict[str, int] = {}
        self._rows: dict[Look, int] = {}
        wrap = [{"wrapS": w, "wrapT": w, "magFilter": _LINEAR, "minFilter": _MIPMAPS} for w in (_REPEAT, _CLAMP)]
        self._samplers = [glb.add("samplers", sampler) for sampler in wrap]

    def row(self, name: str, step: int = NEUTRAL) -> int:
        """Index of a material at a step of brightness."""
        if (name, step) not in self._rows:
            material = self._world.materials[name]
            gain = self._gain[material.texture]
            self._rows[name, step] = self._add(
                name if step == NEUTRAL else f"{name}@{STEPS[step]:.2f}",
                material.label,
                self._texture(material.texture, gain),
                [float(np.clip(tint * STEPS[step] / gain, 0, 1)) for tint in material.tint],
                roughness=roughness(material),
                translucency=material.translucency,
            )
        return self._rows[name, step]

    def add_image(self, name: str, jpeg: bytes) -> int:
        """Add an image that does not repeat and return the index of its texture."""
        source = self._glb.image(name, jpeg)
        return self._glb.add("textures", {"sampler": self._samplers[1], "source": source})

    def add_ground(self, name: str, label: Label, texture: int) -> int:
        """Add a material of the ground and return its index."""
        return self._add(name, label, texture, [1.0, 1.0, 1.0], roughness=1.0)

    def _texture(self, name: str, gain: float) -> int:
        if name not in self._textures:
            jpeg = encode_image(tinted(self._world.textures[name], (gain, gain, gain)))
            source = self._glb.image(name, jpeg)
            self._textures[name] = self._glb.add("textures", {"sampler": self._samplers[0], "source": source})
        return self._textures[name]

    def _add(
        self, name: str, label: Label, texture: int, factor: list[float], *, roughness: float, translucency: float = 0.0
    ) -> int:
        surface = {
            "baseColorFactor": [*factor, 1.0],
            "baseColorTexture": {"index": texture},
            "metallicFactor": 0.0,
            "roughnessFactor": roughness,
        }
        extras = {"class_id": int(label), "class_name": CLASSES[label].name, "translucency": translucency}
        # Double-sided, as for the ray tracer: leaves and blades are single layers.
        material = {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True, "extras": extras}
        return self._glb.add("materials", material)
