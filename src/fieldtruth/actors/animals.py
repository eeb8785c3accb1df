# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Dogs, roe deer and cattle: four legs of three segments, neck, head and tail, by tables of numbers.

Strides follow Alexander and Jayes (1983, J. Zool. 201, 135-152): a length of 2.4 h Fr^0.34 with the Froude number
Fr = v^2 / (g h) and the hips' height h, and the share of a stride in which a foot carries is 0.52 Fr^-0.14. Up to
Fr = 0.5 they walk (left hind, left fore, right hind, right fore foot), then trot with diagonal pairs, and gallop above
Fr = 2.5. A leg stands on the middle of its round foot, so that it rolls where the foot stays.

Colours are assumed, with three limits. Melanin darkens towards the blue, evenly: no fur reflects more green than red or
more blue than green. The CIELAB chroma of brown and red fur is 25 at most: what naturalists call red is a brown such as
Munsell 5YR 4/4, of chroma 22, and the curve of a camera makes it half as strong again. Roe deer are reddish brown in
summer and greyish brown in winter, with a rump that is yellowish in summer and white in winter.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from fieldtruth.actors.figure import STEP, Figure, Ground, Joint, Placement, fitted
from fieldtruth.actors.limbs import (
    Foot,
    Matrix,
    Motion,
    Rhythm,
    Steps,
    applied,
    ease,
    softest,
    transposed,
    turned,
    two_links,
)
from fieldtruth.actors.shapes import Colour, Surface, dappled, make_ball, make_loft, materials_of, part
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import Label
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.solids import make_tube, placed

_Rows = tuple[tuple[float, float, float, float], ...]


class Coat(NamedTuple):
    """Colours of fur: most of it, of the patches, and where these are: spots, saddle, socks or none."""

    fur: Colour
    other: Colour
    pattern: str = "none"


class Leg(NamedTuple):
    """A pair of legs: place of the joint (x, y, z) in the trunk, and the segments' lengths and half widths."""

    root: tuple[float, float, float]
    lengths: tuple[float, float, float]
    girth: tuple[float, float, float, float]
    """Half widths along x at the joints, from the trunk down."""
    lean: float
    """[rad] of the lowest segment that stands: its foot is behind its upper end."""


class Species(NamedTuple):
    """A species; all lengths are shares of the height of the withers."""

    height: tuple[float, float]
    """[m] least and greatest of the withers."""
    centre: float
    """Height of the trunk's frame, to which the rest refers."""
    trunk: _Rows
    """Sections: x, z of the middle, half the width, half the height."""
    fore: Leg
    hind: Leg
    neck: tuple[tuple[float, float], float, float, float]
    """Joint (x, z), length, angle [rad] upwards, angle when it grazes."""
    neck_girth: tuple[float, float]
    head: _Rows
    """Sections from the back of the head to the muzzle, along x."""
    head_down: float
    """[rad] of the head below the horizontal."""
    ears: tuple[float, float, float, float]
    """Height and half distance of their roots, length, and angle [rad] outwards from above."""
    tail: tuple[float, float, float]
    """Length, half width, and angle [rad] above the horizontal."""
    foot: float
    """Radius."""
    coats: tuple[Coat, ...]
    horns: str
    speed: float
    top_speed: float


DOG: Final = Species(
    height=(0.48, 0.64), centre=0.72,
    trunk=((-0.50, 0.09, 0.09, 0.10), (-0.38, 0.06, 0.140, 0.170), (-0.12, 0.025, 0.15, 0.180),
        (0.12, -0.01, 0.17, 0.23),
           (0.31, 0.01, 0.16, 0.225), (0.45, 0.04, 0.11, 0.16)),
    fore=Leg((0.29, 0.095, 0.13), (0.38, 0.28, 0.205), (0.10, 0.066, 0.044, 0.042), 0.0),
    hind=Leg((-0.37, 0.10, 0.05), (0.27, 0.30, 0.23), (0.135, 0.092, 0.043, 0.040), -0.12),
    neck=((0.39, 0.09), 0.27, 0.80, -0.75), neck_girth=(0.155, 0.115),
    head=((-0.06, 0.0, 0.100, 0.100), (0.05, 0.02, 0.122, 0.125), (0.15, 0.0, 0.100, 0.105),
        (0.21, -0.035, 0.072, 0.072),
          (0.34, -0.045, 0.060, 0.058)),
    head_down=0.15, ears=(0.095, 0.105, 0.19, 2.6), tail=(0.46, 0.034, 0.05), foot=0.050,
    coats=(Coat((0.016, 0.014, 0.013), (0.016, 0.014, 0.013)), Coat((0.40, 0.29, 0.175), (0.48, 0.38, 0.26), "socks"),
           Coat((0.075, 0.035, 0.018), (0.075, 0.035, 0.018)), Coat((0.24, 0.145, 0.077), (0.022, 0.018, 0.016),
               "saddle"),
           Coat((0.020, 0.018, 0.018), (0.60, 0.58, 0.54), "socks"), Coat((0.58, 0.55, 0.50),
               (0.14, 0.075, 0.041), "spots")),
    horns="", speed=1.3, top_speed=8.0,
)  # fmt: skip
DEER: Final = Species(
    height=(0.64, 0.76), centre=0.78,
    trunk=((-0.53, 0.04, 0.075, 0.095), (-0.42, 0.02, 0.13, 0.16), (-0.15, -0.02, 0.145, 0.165),
        (0.12, -0.02, 0.145, 0.185),
           (0.33, 0.01, 0.125, 0.175), (0.45, 0.05, 0.08, 0.12)),
    fore=Leg((0.31, 0.075, 0.07), (0.34, 0.31, 0.28), (0.085, 0.050, 0.026, 0.022), 0.0),
    hind=Leg((-0.40, 0.085, 0.02), (0.28, 0.34, 0.33), (0.13, 0.075, 0.030, 0.022), -0.16),
    neck=((0.40, 0.10), 0.50, 0.95, -1.05), neck_girth=(0.105, 0.065),
    head=((-0.05, 0.0, 0.060, 0.070), (0.05, 0.0, 0.072, 0.080), (0.14, -0.015, 0.055, 0.062),
        (0.25, -0.04, 0.034, 0.036),
          (0.31, -0.045, 0.028, 0.028)),
    head_down=0.25, ears=(0.065, 0.05, 0.21, 0.75), tail=(0.04, 0.035, -0.6), foot=0.026,
    coats=(Coat((0.175, 0.092, 0.050), (0.42, 0.32, 0.21), "rump"), Coat((0.150, 0.082, 0.047), (0.38, 0.29, 0.19),
        "rump")),
    horns="antlers", speed=0.9, top_speed=9.0,
)  # fmt: skip
WINTER_DEER: Final = DEER._replace(coats=(Coat((0.145, 0.108, 0.076), (0.56, 0.53, 0.47), "rump"),
    Coat((0.120, 0.092, 0.067), (0.50, 0.47, 0.42), "rump")))  # fmt: skip
"""The grey-brown coat with the white rump that roe deer wear from October to May."""
COW: Final = Species(
    height=(1.32, 1.48), centre=0.70,
    trunk=((-0.60, 0.13, 0.10, 0.11), (-0.52, 0.09, 0.18, 0.19), (-0.38, 0.03, 0.205, 0.235),
        (-0.18, -0.02, 0.225, 0.265),
           (0.02, -0.03, 0.225, 0.275), (0.20, -0.01, 0.20, 0.275), (0.36, 0.0, 0.165, 0.255),
           (0.50, 0.02, 0.11, 0.19)),
    fore=Leg((0.30, 0.115, 0.12), (0.40, 0.26, 0.19), (0.13, 0.075, 0.042, 0.036), 0.0),
    hind=Leg((-0.43, 0.12, 0.03), (0.24, 0.28, 0.26), (0.17, 0.105, 0.046, 0.036), -0.10),
    neck=((0.42, 0.09), 0.38, 0.30, -0.98), neck_girth=(0.185, 0.105),
    head=((-0.06, 0.0, 0.085, 0.080), (0.03, 0.0, 0.098, 0.105), (0.14, -0.025, 0.080, 0.090),
        (0.27, -0.045, 0.060, 0.064),
          (0.34, -0.05, 0.062, 0.056)),
    head_down=0.50, ears=(0.035, 0.085, 0.14, 1.75), tail=(0.58, 0.022, -1.35), foot=0.042,
    coats=(Coat((0.58, 0.56, 0.52), (0.014, 0.013, 0.013), "spots"), Coat((0.56, 0.52, 0.45),
        (0.165, 0.075, 0.039), "spots"),
           Coat((0.17, 0.105, 0.060), (0.17, 0.105, 0.060)), Coat((0.022, 0.017, 0.015), (0.022, 0.017, 0.015))),
    horns="horns", speed=0.8, top_speed=4.0,
)  # fmt: skip
_LEGS: Final = ("left fore", "right fore", "left hind", "right hind")
_WALK, _TROT, _GALLOP = (0.75, 0.25, 0.0, 0.5), (0.5, 0.0, 0.0, 0.5), (0.5, 0.4, 0.0, 0.9)
"""Shares of a stride by which the legs are early."""


def _centred(species: Species) -> Species:
    """Return a species whose root is below the middle between the ends of muzzle and tail."""
    (x, _), reach, up, _ = species.neck
    nose = x + reach * math.cos(up) + species.head[-1][0] * math.cos(species.head_down) + 0.04
    rump = species.trunk[0][0] - 0.06
    back = min(rump, species.trunk[0][0] - 0.03 - species.tail[0] * math.cos(species.tail[2]))
    shift = (nose + back) / 2
    fore, hind = (leg._replace(root=(leg.root[0] - shift, *leg.root[1:])) for leg in (species.fore, species.hind))
    trunk = tuple((along - shift, z, wide, high) for along, z, wide, high in species.trunk)
    neck = ((x - shift, species.neck[0][1]), *species.neck[1:])
    return species._replace(trunk=trunk, fore=fore, hind=hind, neck=neck)


class AnimalKind:
    """Makes animals of a species."""

    def __init__(self, name: str, species: Species) -> None:
        self._name, self._species = name, _centred(species)

    def figure(self, name: str, rng: np.random.Generator) -> Figure:
        """Return an animal of random size and coat. Fur reflects half of a LiDAR's light, black fur less (assumed)."""
        species, size = self._species, float(rng.uniform(*self._species.height))
        coat = species.coats[rng.integers(len(species.coats))]
        shade = rng.uniform(0.85, 1.15)

        def fur(colour: Colour) -> Surface:
            return Surface(
                (colour[0] * shade, colour[1] * shade, colour[2] * shade), 0.25 if colour[0] < 0.05 else 0.5, 0.05
            )

        surfaces = {"fur": fur(coat.fur), "patch": fur(coat.other), "dark": Surface((0.018, 0.015, 0.014), 0.15, 0.3),
            "horn": Surface((0.20, 0.16, 0.11), 0.4, 0.1), "pink": Surface((0.42, 0.22, 0.17), 0.5)}  # fmt: skip
        length = species.trunk[-1][0] - species.trunk[0][0]
        collider = Collider(shape="box", size=(size * length, size * 0.36, size),
            position=(size * (species.trunk[-1][0] + species.trunk[0][0]) / 2, 0.0, 0.0))  # fmt: skip
        figure = Figure(
            kind=self._name,
            label=Label.ANIMAL,
            parts=_body(name, species, size, coat, rng),
            joints=_joints(species, size),
            materials=materials_of(name, Label.ANIMAL, surfaces),
            colliders=(collider,),
            radius=size * 0.7,
            reach=0.3,
            speed=species.speed,
            top_speed=species.top_speed,
            scale=size,
        )
        return fitted(figure, self)

    def gait(self, figure: Figure, placement: Placement, ground: Ground, rng: np.random.Generator) -> "AnimalGait":
        """Return the motion of an animal's limbs."""
        return AnimalGait(self._species, figure.scale, placement, ground, rng)


def _joints(species: Species, size: float) -> tuple[Joint, ...]:
    (nx, nz), reach = species.neck[0], species.neck[1]
    back, high, _, half = species.trunk[0]
    found = [Joint(f"trunk_{axis}", 0, -1, (0, 0, 0), axis) for axis in ("lift", "y", "x")]
    found += [Joint(f"neck_{axis}", 1, 0, (size * nx, 0, size * nz), axis) for axis in "zy"]
    found += [Joint(f"head_{axis}", 2, 1, (size * reach, 0, 0), axis) for axis in "zy"]
    found += [Joint(f"tail_{axis}", 3, 0, (size * (back - 0.03), 0, size * (high + 0.5 * half)), axis) for axis in "zy"]
    for k, name in enumerate(_LEGS):
        leg, first, key = species.fore if k < 2 else species.hind, 4 + 3 * k, name.replace(" ", "_")
        x, y, z = leg.root
        root = (size * x, size * y * (1 - 2 * (k % 2)), size * z)
        found += [Joint(f"{key}_root_{axis}", first, 0, root, axis) for axis in "xy"]
        found.append(Joint(f"{key}_middle", first + 1, first, (0, 0, -size * leg.lengths[0]), "y"))
        found.append(Joint(f"{key}_low", first + 2, first + 1, (0, 0, -size * leg.lengths[1]), "y"))
    return tuple(found)


def _patches(species: Species, size: float, coat: Coat, rng: np.random.Generator) -> Callable[..., Mesh]:
    """Return what puts patches on a part: its mesh, and the trunk's or another part's name."""
    waves = rng.normal(size=(5, 3)) * 4.5 / size
    phases, sign = rng.uniform(0, 2 * np.pi, 5), 1.0 if rng.random() < 0.5 else -1.0

    def where(points: Array, place: str) -> Mask:
        x, z = points[:, 0] / size, points[:, 2] / size
        along = x - species.trunk[0][0]
        if coat.pattern == "spots":
            shift = {"neck": 0.7, "head": 1.1}.get(place, 0.0)
            value = np.sin(points @ waves.T + phases + shift).sum(axis=1)
            return (value > 0.15) if not place.endswith("low") else np.zeros(len(x), bool)
        if coat.pattern == "saddle":
            on_head = (place == "head") & (x > 0.17)
            return (
                on_head | (place == "tail") | ((place in ("trunk", "neck")) & (z > 0.05 + 0.03 * np.sin(9 * x * sign)))
            )
        if coat.pattern == "socks":
            chest = (place == "trunk") & (along > 0.86) & (z < 0.1)
            return chest | place.endswith("low") | ((place == "head") & (x > 0.24) | ((place == "neck") & (z < -0.05)))
        belly = (place == "trunk") & (z < -0.13) & (along < 0.78)
        rump = (place == "trunk") & (along < -0.005) & (z > -0.1) | (place == "tail")
        return belly | rump | ((place == "neck") & (z < -0.06) & (x > 0.2))

    def put(mesh: Mesh, place: str, origin: Sequence[float] = (0.0, 0.0, 0.0)) -> Mesh:
        if coat.pattern == "none":
            return mesh
        name = mesh.materials[0]
        return dappled(
            mesh,
            name.removesuffix("fur") + "patch",
            lambda points: np.broadcast_to(where(points + origin, place), len(points)),
        )

    return put


def _body(name: str, species: Species, size: float, coat: Coat, rng: np.random.Generator) -> tuple[Mesh, ...]:
    """Return the 16 parts: trunk, neck, head, tail, and four legs of three."""
    put = _patches(species, size, coat, rng)

    def along(rows: _Rows, sides: int, **others: float) -> Mesh:
        table = np.array([(x, 0, z, wide, high) for x, z, wide, high in rows])
        count = 4 * len(rows) - 3 if sides > 12 else len(rows)
        smooth = PchipInterpolator(np.arange(len(rows)), table)(np.linspace(0, len(rows) - 1, count))
        return make_loft(f"{name} fur", size * smooth, axis=0, sides=sides, **others)

    trunk = [put(along(species.trunk, 28, bulge=0.8), "trunk")]
    if species.horns == "horns" and rng.random() < 0.7:
        trunk.append(make_ball(f"{name} pink", [size * (species.trunk[0][0] + 0.30), 0, -0.24 * size],
            [0.12 * size, 0.10 * size, 0.10 * size]))  # fmt: skip
    reach, (low, high) = species.neck[1], species.neck_girth
    neck = along(((-0.06, -0.01, 0.9 * low, low), (0.4 * reach, 0.0, 0.72 * (low + high) / 2, (low + high) / 2),
        (reach, 0.0, 0.85 * high, high)), 16)  # fmt: skip
    length, thick, _ = species.tail
    tail = [
        put(
            make_loft(
                f"{name} fur",
                size * np.array([(-length, 0, 0, 0.7 * thick, 0.7 * thick), (0.02, 0, 0, thick, thick)]),
                axis=0,
            ),
            "tail",
        )
    ]
    if species.horns == "horns":
        tail.append(
            make_ball(f"{name} patch", [-size * length, 0, 0], [size * 0.09, size * 0.035, size * 0.035], sides=8)
        )
    parts = [
        part(f"{name} trunk", *trunk),
        part(f"{name} neck", put(neck, "neck")),
        part(f"{name} head", *_head(name, species, size, put, rng)),
        part(f"{name} tail", *tail),
    ]
    for k, leg_name in enumerate(_LEGS):
        meshes = _leg_meshes(name, species, size, k, put)
        parts += [part(f"{name} {leg_name} {each}", *meshes[each]) for each in ("upper", "middle", "low")]
    return tuple(parts)


def _leg_meshes(name: str, species: Species, size: float, k: int, put: Callable[..., Mesh]) -> dict[str, list[Mesh]]:
    """Return the meshes of a leg's segments."""
    leg = species.fore if k < 2 else species.hind
    (a, b, c, d), (upper, middle, lower) = leg.girth, leg.lengths
    top = [(0.0, 0, 0, 0.75 * a, 0.36 * a), (-0.35 * upper, 0, 0, a, 0.58 * a)]
    rows = {
        "upper": [*top, (-0.7 * upper, 0, 0, 0.4 * a + 0.6 * b, 0.3 * a + 0.4 * b), (-upper, 0, 0, b, 0.75 * b)],
        "middle": [
            (0.0, 0, 0, b, 0.75 * b),
            (-0.35 * middle, 0, 0, 0.65 * b + 0.2 * c, 0.6 * b),
            (-middle, 0, 0, c, c),
        ],
        "low": [(0.0, 0, 0, c, 0.9 * c), (-0.25 * lower, 0, 0, 0.8 * d, 0.75 * d), (-lower, 0, 0, d, d)],
    }
    place = [size * v * w for v, w in zip(leg.root, (1, 1 - 2 * (k % 2), 1), strict=True)]
    found = {}
    for key, each in rows.items():
        found[key] = [put(make_loft(f"{name} fur", size * np.array(each), sides=8, bulge=0.7), f"leg {key}", place)]
    r, surface = species.foot * size, "dark" if species.horns else "fur"
    foot = make_ball(f"{name} {surface}", (0.2 * r, 0, -lower * size), (1.15 * r, r, 0.88 * r))
    found["low"].append(foot if species.horns else put(foot, "leg low"))
    return found


def _head(name: str, species: Species, size: float, put: Callable[..., Mesh], rng: np.random.Generator) -> list[Mesh]:
    """Return head, muzzle, eyes, ears, and horns or antlers."""
    rows = np.array([(x, 0, z, wide, high) for x, z, wide, high in species.head])
    found = [put(make_loft(f"{name} fur", size * rows, axis=0, sides=12, bulge=0.6), "head")]
    x, _, z, wide, high = rows[-1]
    key = "pink" if species.horns == "horns" and rng.random() < 0.5 else "dark"
    found.append(make_ball(f"{name} {key}", size * np.array([x + 0.45 * high, 0, z + 0.25 * high]),
        size * np.array([0.5 * high, 0.7 * wide, 0.6 * high]), sides=8))  # fmt: skip
    up, out, long, angle = species.ears
    for y in (1.0, -1.0):
        eye = rows[2] if species.horns != "horns" else rows[1]
        found.append(make_ball(f"{name} dark", size * np.array([eye[0], 0.86 * eye[3] * y, eye[2] + 0.5 * eye[4]]),
            [size * 0.017] * 3, sides=6, rings=4))  # fmt: skip
        ear = make_ball(f"{name} fur", (0, 0, 0.5 * size * long),
            (0.32 * size * long, 0.10 * size * long, 0.58 * size * long), sides=8)  # fmt: skip
        found.append(
            put(placed(ear, transforms.pose((0.0, size * out * y, size * up), (-math.degrees(angle) * y, 0, 0))), "ear")
        )
    if (species.horns == "horns" and rng.random() < 0.5) or (species.horns == "antlers" and rng.random() < 0.5):
        for y in (1.0, -1.0):
            if species.horns == "horns":
                path = np.array([(0.0, 0.06, 0.07), (0.0, 0.15, 0.10), (0.03, 0.19, 0.17), (0.05, 0.18, 0.22)])
                found.append(make_tube(f"{name} horn", size * path * (1, y, 1),
                    size * np.array([0.022, 0.019, 0.013, 0.005]), sides=7))  # fmt: skip
            else:
                path = np.array([(0.03, 0.03, 0.06), (0.0, 0.06, 0.18), (0.02, 0.07, 0.32)])
                tine = np.array([(0.0, 0.06, 0.19), (0.08, 0.07, 0.25)])
                for each in (path, tine):
                    found.append(make_tube(f"{name} horn", size * each * (1, y, 1),
                        size * np.linspace(0.016, 0.007, len(each)), sides=6))  # fmt: skip
    return found


class AnimalGait:
    """Walks, trots, gallops, stands and grazes."""

    def __init__(
        self, species: Species, size: float, placement: Placement, ground: Ground, rng: np.random.Generator
    ) -> None:
        self._species, self._size, self._ground = species, size, ground
        self.motion = Motion(placement)
        self._graze = 1.0 if placement.action == "graze" else 0.0
        self._time = float(rng.uniform(0, 100))
        legs = [species.fore if k < 2 else species.hind for k in range(4)]
        self._legs = [(tuple(size * v for v in (leg.root[0], leg.root[1] * (1 - 2 * (k % 2)), leg.root[2])),
            tuple(size * v for v in leg.lengths), leg.lean) for k, leg in enumerate(legs)]  # fmt: skip
        self.feet = tuple(Foot((root[0] + size * (0.02 if k < 2 else -0.04), root[1]), _WALK[k]) for k,
            (root, *_) in enumerate(self._legs))  # fmt: skip
        self._choose(abs(placement.speed))
        self._steps = Steps(self.feet, self.motion, ground, (0.0, 0.0, 0.0), self._rhythm(abs(placement.speed)))

    def _choose(self, speed: float) -> tuple[float, float, float]:
        """Set in which order the feet step; return the Froude number, and how much it trots and gallops."""
        froude = speed * speed / (GRAVITY * 0.8 * self._size)
        trots, gallops = ease((froude - 0.4) / 0.2), ease((froude - 2.0) / 1.0)
        for k, foot in enumerate(self.feet):
            foot.offset = _WALK[k] + trots * (_TROT[k] - _WALK[k]) + gallops * (_GALLOP[k] - _TROT[k])
        return froude, trots, gallops

    def _rhythm(self, speed: float) -> Rhythm:
        hips = 0.8 * self._size
        froude = speed * speed / (GRAVITY * hips)
        stride = 2.4 * hips * max(froude, 1e-4) ** 0.34
        duty = min(max(0.52 * max(froude, 1e-4) ** -0.14, 0.3), 0.72)
        gallops = ease((froude - 2.0) / 1.0)
        frequency = max(speed / stride, 0.45 * math.sqrt(1.0 / hips))
        duty = min(duty * (1.0 - 0.35 * gallops), 0.72 * self._size * frequency / max(speed, 0.1))
        return Rhythm(frequency, duty, self._size * (0.07 + 0.04 * min(froude, 2.0)), 0.5)

    def step(self, placement: Placement) -> tuple[Array, Array]:
        """Return world_from_root (4, 4) and the joints' values at the next knot."""
        motion, size, ground = self.motion, self._size, self._ground
        motion.follow(placement)
        self._time += STEP
        self._graze = min(max(self._graze + (STEP / 1.6 if placement.action == "graze" else -STEP / 0.8), 0.0), 1.0)
        speed = math.hypot(motion.vx, motion.vy)
        froude, trots, gallops = self._choose(speed)
        self._steps.step(self._rhythm(speed), ground)
        c, s = math.cos(motion.heading), math.sin(motion.heading)
        front, back = self._legs[0][0][0], self._legs[2][0][0]
        z = ground(motion.x, motion.y)
        fore, hind = (
            ground(motion.x + front * c, motion.y + front * s),
            ground(motion.x + back * c, motion.y + back * s),
        )
        turn = math.tau * self._steps.phase
        pitch = -math.atan2(fore - hind, front - back) + 0.09 * gallops * math.sin(turn + 1.0)
        level = (fore * -back + hind * front) / (front - back) - z
        rotation = turned(motion.heading, pitch, 0.0)
        wrists = [self._wrist(k, rotation, froude) for k in range(4)]
        stands = level + size * self._species.centre * (1.0 - 0.03 * ease(froude / 0.3))
        lift = softest((stands + size * 0.015 * trots * (1 - gallops) * math.sin(2 * turn),
            *self._reach(wrists, rotation, z, stands)), 0.01 * size)  # fmt: skip
        values = [lift, pitch, 0.0, *self._others(speed, froude, pitch)]
        for k, wrist in enumerate(wrists):
            values += self._leg(k, wrist[3], rotation, z + lift)
        root = np.array([[c, -s, 0.0, motion.x], [s, c, 0.0, motion.y], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]])
        return root, np.array(values)

    def _others(self, speed: float, froude: float, pitch: float) -> tuple[float, ...]:
        """Return the angles of neck, head and tail."""
        species, graze, t = self._species, ease(self._graze), self._time
        _, _, up, down = species.neck
        walk, twice = min(speed / 0.6, 1.0), 2.0 * math.tau * self._steps.phase
        rise = up - 0.25 * ease(froude / 3.0) + 0.03 * walk * math.sin(twice) + graze * (down - up)
        still = (1.0 - walk) * (1.0 - graze)
        look = 0.5 * still * math.sin(0.37 * t) * math.sin(0.11 * t) + 0.12 * graze * math.sin(0.8 * t)
        look += min(max(0.4 * self.motion.turn, -0.5), 0.5)
        chew = 0.03 * graze * math.sin(7.0 * t)
        nod = species.head_down + graze * (1.15 - species.head_down) + chew
        wags = {"": (0.45 * (1 - walk) + 0.12, 11.0), "horns": (0.5 * math.sin(0.23 * t) ** 4, 3.5)}
        wide, rate = wags.get(species.horns, (0.0, 1.0))
        tail = species.tail[2] + 0.3 * ease(froude / 2.0)
        return (0.6 * look, -rise - 0.8 * pitch, 0.4 * look, rise - 0.2 * pitch + nod, wide * math.sin(rate * t), tail)

    def _wrist(self, k: int, rotation: Matrix, froude: float) -> tuple[float, float, float, float]:
        """Return where the upper end of the lowest segment is in the world [m], and its angle from upright [rad]."""
        foot, (root, lengths, lean) = self.feet[k], self._legs[k]
        motion, size = self.motion, self._size
        dx, dy, _ = applied(rotation, root[0], root[1], 0.0)
        c, s = math.cos(motion.heading), math.sin(motion.heading)
        ahead = (foot.x - motion.x - dx) * c + (foot.y - motion.y - dy) * s
        angle = lean - (1.3 if k < 2 else 1.2) * ahead / size
        if not foot.carries:
            raised = 16.0 * (foot.share * (1.0 - foot.share)) ** 2
            angle += raised * (0.75 if k < 2 else 0.65) * (0.6 + 0.4 * min(froude, 1.0))
        out, up = lengths[2] * math.sin(angle), lengths[2] * math.cos(angle)
        return foot.x + out * c, foot.y + out * s, foot.z + self._species.foot * size + up, angle

    def _reach(
        self, wrists: list[tuple[float, float, float, float]], rotation: Matrix, z: float, stands: float
    ) -> list[float]:
        """Return the greatest heights of the trunk at which the legs reach the ground; lift feet that are too far."""
        found = []
        for k, (x, y, high, _) in enumerate(wrists):
            root, lengths, _ = self._legs[k]
            dx, dy, dz = applied(rotation, *root)
            far = (self.motion.x + dx - x) ** 2 + (self.motion.y + dy - y) ** 2
            most = high - z - dz + math.sqrt(max((0.99 * (lengths[0] + lengths[1])) ** 2 - far, 0.0))
            foot = self.feet[k]
            if foot.carries and most < stands - 0.05 * self._size:
                self._steps.lift(foot, 0.2)
            found.append(most + 0.2 * self._size * ease(foot.share / 0.3) * (1.0 - ease((foot.share - 0.4) / 0.4)))
        return found

    def _leg(self, k: int, low: float, rotation: Matrix, z: float) -> list[float]:
        """Return the angles of a leg with the trunk at a height [m] in the world."""
        root, (upper, middle, lower), _ = self._legs[k]
        foot, motion = self.feet[k], self.motion
        hoof = foot.z + self._species.foot * self._size
        x, y, down = applied(transposed(rotation), foot.x - motion.x, foot.y - motion.y, hoof - z)
        x, y, down = x - root[0], y - root[1], down - root[2]
        low -= math.asin(max(-1.0, min(1.0, -rotation[6])))
        out, up = lower * math.sin(low), -math.hypot(y, down) + lower * math.cos(low)
        first, second = two_links(x + out, up, upper, middle, -1.0 if k < 2 else 1.0)
        return [math.atan2(y, -down), first, second, low - first - second]
