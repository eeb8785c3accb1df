# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The actors of an experiment in its world: where each is at the knots of the simulated time, and its parts.

A cast that plays is one knot ahead of the robots: from where they are at a knot it finds where its actors are at the
next. So sensors know their motion up to there, and between two knots all move on straight lines (``sense.moving``).
Between knots, the root's position changes linearly, and its quaternion is the normalised mean of those at the knots.
"""

import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from io import BytesIO
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.actors.behaviour import Member, RobotState
from fieldtruth.actors.crowd import Crowd
from fieldtruth.actors.figure import STEP, Figure, Gait
from fieldtruth.actors.kinds import IN_WINTER_COAT, KINDS
from fieldtruth.actors.shapes import make_textures
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.random import rng_of
from fieldtruth.core.transforms import quaternion_wxyz_from_rotation
from fieldtruth.experiment.actor_config import MOST_ACTORS, actor_names
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.fields import validated_as
from fieldtruth.sense.moving import KNOT_NS, KnotPoses, MovingBody
from fieldtruth.world.build import layout_model
from fieldtruth.world.model import Collider, Heightfield, World
from fieldtruth.world.seasons import SUMMER


def figures_of(experiment: Experiment) -> dict[str, Figure]:
    """Return the bodies of the actors of an experiment by name."""
    if not experiment.actors:
        return {}
    summer = not any(actor.kind in IN_WINTER_COAT for actor in experiment.actors.values()) or _is_summer(experiment)
    return {
        name: _figure(experiment.actors[key].kind, name, experiment.seed, summer)
        for name, key in actor_names(experiment.actors)
    }


def _is_summer(experiment: Experiment) -> bool:
    """Return whether an experiment is in summer, as one without seasons is; ConfigurationError of its layout."""
    layout = validated_as(layout_model(experiment.environment), experiment.layout, "layout")
    return bool(getattr(layout, "season", SUMMER) == SUMMER)


@lru_cache(maxsize=2 * MOST_ACTORS)
def _figure(kind: str, name: str, seed: int, summer: bool) -> Figure:
    kinds = KINDS if summer else {**KINDS, **IN_WINTER_COAT}
    return kinds[kind].figure(name, rng_of(seed, "actor", name, "figure"))


_NONE: Final = np.zeros(0)


class Actor:
    """An actor: its figure, and the poses of its root and the values of its joints at the knots that are known."""

    def __init__(self, name: str, figure: Figure) -> None:
        self.name, self.figure = name, figure
        self.roots = KnotPoses()
        """world_from_root (4, 4) at each knot."""
        self.joints = KnotPoses()
        """Values (joints,) at each knot."""
        self._last: tuple[bytes, Array] = (b"", np.zeros((0, 0, 4, 4)))

    def add(self, root: Array, joints: Array) -> None:
        """Add the next knot."""
        self.roots.add([root])
        self.joints.add([joints])

    def parts(self, knots_ns: ArrayLike) -> Array:
        """Return world_from_part (n, parts, 4, 4) at knots (n,) [ns]; behind the last one, those of the last."""
        known_ns = np.clip(np.asarray(knots_ns), 0, (len(self.roots) - 1) * KNOT_NS)
        key, (known, poses) = known_ns.tobytes(), self._last  # one tuple: threads may ask at once
        if key != known:
            poses = self.figure.poses(self.roots(known_ns), self.joints(known_ns))
            self._last = key, poses
        return poses

    def restart(self, roots: Array = _NONE, joints: Array = _NONE) -> None:
        """Forget all knots, and know the first ones instead: world_from_root (n, 4, 4), values (n, joints)."""
        self.roots.restart(*roots)
        self.joints.restart(*joints)
        self._last = b"", self._last[1]

    def end(self, knots: int) -> None:
        """Know only the first knots, so many."""
        self.roots.end(knots)
        self.joints.end(knots)
        self._last = b"", self._last[1]

    def forget(self, before_ns: int) -> None:
        """Forget the knots that no stamp from this one [ns] on needs."""
        self.roots.forget(before_ns)
        self.joints.forget(before_ns)

    def save(self) -> Any:
        """Return what ``restore`` needs."""
        return self.roots.save(), self.joints.save()

    def restore(self, saved: Any) -> None:
        """Know what was known when ``save`` was called."""
        self.roots.restore(saved[0])
        self.joints.restore(saved[1])
        self._last = b"", self._last[1]

    def bodies(self, object_id: int) -> list[MovingBody]:
        """Return its parts as bodies that move."""

        def pose_of(part: int) -> Callable[[NDArray[np.int64]], Array]:
            return lambda knots: np.asarray(self.parts(knots)[:, part])

        return [
            MovingBody(name=mesh.name, object_id=object_id, mesh=mesh, pose=pose_of(part))
            for part, mesh in enumerate(self.figure.parts)
        ]


class Heights:
    """Heights [m] of a heightfield at single points, in a tenth of the time of ``height_at``."""

    def __init__(self, field: Heightfield) -> None:
        self._heights, self._x0, self._y0, self._per_m = field.heights, field.x0, field.y0, 1.0 / field.spacing
        self._last = field.heights.shape[0] - 1, field.heights.shape[1] - 1

    def __call__(self, x: float, y: float) -> float:
        """Return the height [m] at x, y [m]; outside the grid that of its edge."""
        u = min(max((x - self._x0) * self._per_m, 0.0), self._last[0])
        v = min(max((y - self._y0) * self._per_m, 0.0), self._last[1])
        i, j = min(int(u), self._last[0] - 1), min(int(v), self._last[1] - 1)
        fu, fv, at = u - i, v - j, self._heights.item
        low, high = at(i, j), at(i + 1, j + 1)
        corner = at(i + 1, j) if fu >= fv else at(i, j + 1)
        first, second = max(fu, fv), min(fu, fv)
        return float(low + first * (corner - low) + second * (high - corner))


class _Pickler(pickle.Pickler):
    """Stores gaits without what they refer to and never changes."""

    def __init__(self, file: BytesIO, known: Sequence[object]) -> None:
        super().__init__(file)
        self._rows = {id(each): row for row, each in enumerate(known)}

    def persistent_id(self, obj: object) -> int | None:
        """Return the row of what is known; None of all else."""
        return self._rows.get(id(obj))


class _Unpickler(pickle.Unpickler):
    """Reads gaits of ``_Pickler``; only states that this process or its user made are read."""

    def __init__(self, file: BytesIO, known: Sequence[object]) -> None:
        super().__init__(file)
        self._known = known

    def persistent_load(self, pid: int) -> object:
        """Return what is known."""
        return self._known[pid]


class CastState(NamedTuple):
    """State of a cast, for ``Cast.restore``."""

    motion: list[Any]
    """Of each actor."""
    crowd: Any
    gaits: list[bytes]


class Cast:
    """The actors of an experiment.

    Args:
        experiment: with actors.
        world: that of the robots, which does not know the actors.

    Raises:
        ConfigurationError: an object of the world has the name of an actor.
    """

    def __init__(self, experiment: Experiment, world: World) -> None:
        self._experiment, self._seed = experiment, experiment.seed
        named = figures_of(experiment)
        if taken := [name for name in named if name in world.object_names]:
            raise ConfigurationError(f"actors.{taken[0]}: an object of the world {world.name} has this name")
        self.actors = {name: Actor(name, figure) for name, figure in named.items()}
        figures = list(named.values())
        self.world = replace(
            world,
            materials={**world.materials, **{k: v for figure in figures for k, v in figure.materials.items()}},
            textures={**world.textures, **make_textures()},
            object_names=(*world.object_names, *self.actors),
        )
        """The world with the materials and instance ids of the actors."""
        self._ground = Heights(world.terrain.field)
        self._crowd: Crowd | None = None
        self._gaits: list[Gait] = []

    @property
    def colliders(self) -> dict[str, tuple[Collider, ...]]:
        """What robots hit, by name, in the root's frame; multirotors hit nothing."""
        return {name: actor.figure.colliders for name, actor in self.actors.items() if actor.figure.colliders}

    def bodies(self) -> list[MovingBody]:
        """Return the parts of all actors."""
        names = self.world.object_names
        return [body for name, actor in self.actors.items() for body in actor.bodies(names.index(name))]

    def begin(self, ways: Sequence[Array], robots: Sequence[RobotState]) -> None:
        """Put all actors where they begin at time 0, and find where they are at the first knot.

        Args:
            ways: each (n, 2) [m], that the robots are expected to drive.
            robots: at time 0.

        Raises:
            ConfigurationError: an actor cannot begin where it should.
        """
        figures, configs = [each.figure for each in self.actors.values()], self._experiment.actors
        members = [
            Member(
                name,
                configs[key],
                figure.radius,
                figure.speed,
                figure.top_speed,
                figure.turn_radius,
                figure.flies,
                key if configs[key].together else "",
            )
            for (name, key), figure in zip(actor_names(configs), figures, strict=True)
        ]
        self._crowd = Crowd(self.world, members, seed=self._seed, ways=ways, robots=robots)
        self._gaits = [
            KINDS[member.config.kind].gait(
                figure, placement, self._ground, rng_of(self._seed, "actor", member.name, "gait")
            )
            for member, figure, placement in zip(members, figures, self._crowd.placements, strict=True)
        ]
        for actor in self.actors.values():
            actor.restart()
        self._add()
        self.step(robots)

    def step(self, robots: Sequence[RobotState]) -> None:
        """Find where all are one knot later, from where the robots are at the last knot but one."""
        assert self._crowd is not None
        self._crowd.step(robots)
        self._add()

    def _add(self) -> None:
        assert self._crowd is not None
        for actor, gait, placement in zip(self.actors.values(), self._gaits, self._crowd.placements, strict=True):
            actor.add(*gait.step(placement))

    @property
    def known_ns(self) -> int:
        """Last knot [ns] that is known; -1 before the first."""
        return (len(next(iter(self.actors.values())).roots) - 1) * KNOT_NS if self._crowd else -1

    def end(self, knot_ns: int) -> None:
        """Let all stand from a knot [ns] on."""
        for actor in self.actors.values():
            actor.end(knot_ns // KNOT_NS + 1)

    def forget(self, before_ns: int) -> None:
        """Forget the motion that no stamp from this one [ns] on needs."""
        for actor in self.actors.values():
            actor.forget(before_ns)

    def roots(self, knot_ns: int) -> dict[str, Array]:
        """Return world_from_root (4, 4) of all by name at a knot [ns]."""
        return {name: actor.roots([knot_ns])[0] for name, actor in self.actors.items()}

    def twists(self, knot_ns: int) -> dict[str, Array]:
        """Return velocity [m/s] and turn rate [rad/s] in the world, (6,) by name, from a knot [ns] to the next."""
        before, after = self.roots(knot_ns), self.roots(knot_ns + KNOT_NS)
        return {name: twist_between(before[name][None], after[name][None])[0] for name in self.actors}

    def save(self) -> CastState:
        """Return what ``restore`` needs to go on from here."""
        assert self._crowd is not None
        motion = [actor.save() for actor in self.actors.values()]
        known = self._known()
        gaits = list[bytes]()
        for gait in self._gaits:
            stored = BytesIO()
            _Pickler(stored, known).dump(gait)
            gaits.append(stored.getvalue())
        return CastState(motion, self._crowd.save(), gaits)

    def _known(self) -> list[object]:
        """Return what gaits refer to and do not change."""
        return [self._ground, *(actor.figure for actor in self.actors.values())]

    def restore(self, saved: CastState) -> None:
        """Go on from where ``save`` was called, in this cast."""
        assert self._crowd is not None
        self._crowd.restore(saved.crowd)
        known = self._known()
        self._gaits = [_Unpickler(BytesIO(stored), known).load() for stored in saved.gaits]
        for actor, motion in zip(self.actors.values(), saved.motion, strict=True):
            actor.restore(motion)


def twist_between(before: Array, after: Array) -> Array:
    """Velocity [m/s] and turn rate [rad/s] in the world, (n, 6), between poses (n, 4, 4) of one knot and the next."""
    turned = Rotation.from_matrix(after[:, :3, :3] @ before[:, :3, :3].transpose(0, 2, 1)).as_rotvec()
    return np.concatenate([after[:, :3, 3] - before[:, :3, 3], turned], axis=1) / STEP


class ActorStates:
    """Poses and twists of actors at any stamp, for /gazebo/model_states, and their joints at knots.

    Args:
        actors: by name, whose motion is known.
    """

    def __init__(self, actors: Mapping[str, Actor]) -> None:
        self.names = tuple(actors)
        self.joint_names = tuple(
            f"{name}/{joint.name}" for name, each in actors.items() for joint in each.figure.joints
        )
        self.actors = actors
        self._interval: tuple[int, Array, Array, Array] | None = None

    def digest(self) -> list[Array]:
        """Return all that is known, as the key of what is made of it."""
        return [values.known for each in self.actors.values() for values in (each.roots, each.joints)]

    def at(self, stamp_ns: int) -> tuple[Array, Array]:
        """Return poses (actors, 7), position and quaternion_xyzw, and twists (actors, 6) at a stamp [ns].

        A twist is that of the interval that ends at the stamp or contains it.
        """
        number = max(-(-stamp_ns // KNOT_NS), 1)
        known = self._interval  # one tuple: threads may ask at once
        if known is None or known[0] != number:
            known = self._interval = number, *self._between(number)
        _, before, after, twists = known
        share = stamp_ns / KNOT_NS - (number - 1)
        poses = before + share * (after - before)
        poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
        return poses, twists

    def _between(self, number: int) -> tuple[Array, Array, Array]:
        """Return poses at the knot before and at this one, quaternions nearest to each other, and the twists."""
        every = list(self.actors.values())
        knots = [(number - 1) * KNOT_NS, number * KNOT_NS]
        roots = np.array([each.roots(knots) for each in every]).swapaxes(0, 1)
        before, after = (
            np.concatenate([each[:, :3, 3], quaternion_wxyz_from_rotation(each[:, :3, :3])[:, [1, 2, 3, 0]]], axis=1)
            for each in roots
        )
        after[:, 3:] *= np.where(np.einsum("ij,ij->i", before[:, 3:], after[:, 3:]) < 0, -1.0, 1.0)[:, None]
        return before, after, twist_between(*roots)

    def joints(self, knots_ns: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return values and speeds (n, joints) at knots (n,) [ns]; a speed is that of the interval before."""
        values, before = (
            np.concatenate([each.joints(knots) for each in self.actors.values()], axis=1)
            for knots in (knots_ns, knots_ns - KNOT_NS)
        )
        return values, (values - before) / STEP
