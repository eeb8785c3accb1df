# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Motion along given poses instead of a simulated drive.

Positions follow a cubic spline through the poses, orientations SciPy's rotation spline: velocity, turn rate and their
derivatives are continuous. The rate of the physics samples both; velocity and turn rate are those of the step that ends
at the stamp, as in the physics (``sensors.imu.sensing``). So their sums over all steps are the path and the attitude,
and the IMU of a track that was recorded from the physics reads what it read there. A noisy file makes a noisy IMU.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation, RotationSpline

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.errors import TrackError
from fieldtruth.core.transforms import wxyz_from_xyzw, xyzw_from_wxyz
from fieldtruth.drive.track import STEP_NS, STEP_S, Motion, Track, sweep_steps
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import Collider, World

_STRIDE: Final = 10
"""Rows of the motion between two that are checked: 10 ms."""
_BLOCK: Final = 100_000
"""Rows that the rotation spline computes at once; it takes half a kilobyte for each."""


class _Found(NamedTuple):
    """Depths [m] of the checked rows in a solid, above 0 inside, and what it is."""

    rows: NDArray[np.intp]
    depth: Array
    what: str


def check_motion(world: World, motion: Motion, rig: Rig, file: str, start_ns: int, *, allow_inside: bool) -> None:
    """Check that base_link stays within the world, and that it, LiDARs and cameras stay out of everything solid.

    Args:
        world: the world.
        motion: of base_link.
        rig: the sensors that are enabled are checked.
        file: name of the track file, for messages.
        start_ns: stamp [ns] in the file of the motion's time 0, for messages.
        allow_inside: whether to check the world's edge only.

    Raises:
        TrackError: with the first time, the position and the object.
    """
    rows = np.append(np.arange(0, len(motion.stamps_ns) - 1, _STRIDE), len(motion.stamps_ns) - 1)
    stamps = (motion.stamps_ns[rows] + start_ns) / 1e9
    world_from_base = transforms.pose_from_quaternion_wxyz(motion.position[rows], motion.quaternion_wxyz[rows])
    half = np.array(world.size) / 2
    outside = (np.abs(world_from_base[:, :2, 3]) > half).any(axis=1)
    if outside.any():
        k = int(np.argmax(outside))
        raise TrackError(
            f"{file}: at {stamps[k]:.3f} s base_link is {_at(world_from_base[k, :3, 3])}, outside the world "
            f"{world.name}, which spans x -{half[0]:g} to {half[0]:g} m, y -{half[1]:g} to {half[1]:g} m"
        )
    if not allow_inside and (first := _first_inside(world, world_from_base, rig)) is not None:
        k, what = first
        raise TrackError(f"{file}: from {stamps[k]:.3f} s on {what}; drive: {{allow_inside: true}} senses there")


def _first_inside(world: World, world_from_base: Array, rig: Rig) -> tuple[int, str] | None:
    """Return the first of the poses (n, 4, 4) that is inside something, and what is where."""
    first: tuple[int, str] | None = None
    for frame, offset in _points(rig).items():
        points = (world_from_base @ np.append(offset, 1.0))[:, :3]
        for found in _solids(world, points):
            inside = found.rows[found.depth > 0]
            if len(inside) and (first is None or inside[0] < first[0]):
                deepest = int(np.argmax(found.depth))
                where = _at(points[found.rows[deepest]])
                first = int(inside[0]), f"{frame} is {found.what}, up to {found.depth[deepest]:.2f} m {where}"
    return first


def _points(rig: Rig) -> dict[str, tuple[float, float, float]]:
    """Checked points in base_link [m] by frame."""
    mounts = (item for sensor in rig.in_order() if sensor.sees for item in sensor.frames().items())
    origins = {frame: mount.xyz for frame, mount in mounts}
    return {"base_link": (0.0, 0.0, 0.0), **origins}


def _solids(world: World, points: Array) -> Iterator[_Found]:
    """Yield the depths of points (n, 3) [m] in the ground, in water, and in the colliders of objects near them."""
    every = np.arange(len(points))
    ground = world.terrain.field.height_at(points[:, 0], points[:, 1])
    yield _Found(every, ground - points[:, 2], "below the ground")
    if world.water_level is not None:
        wet = every[ground < world.water_level]
        yield _Found(wet, world.water_level - points[wet, 2], "under water")
    plan = KDTree(points[:, :2])
    for instance in world.instances:
        for collider in world.meshes[instance.mesh].colliders:
            world_from_solid = instance.world_from_object @ transforms.pose(
                collider.position, (0.0, 0.0, collider.yaw_deg)
            )
            scale = float(np.cbrt(np.linalg.det(world_from_solid[:3, :3])))
            reach = scale * float(np.linalg.norm(collider.size))  # of a sphere around the middle of the base
            near = np.array(plan.query_ball_point(world_from_solid[:2, 3], reach, return_sorted=True), np.intp)
            if len(near):
                in_solid = transforms.transform(np.linalg.inv(world_from_solid).astype(np.float64), points[near])
                depth = _depth(collider, in_solid) * scale
                yield _Found(near, depth, f"inside the object {instance.name!r}")


def _depth(collider: Collider, points: Array) -> Array:
    """Depth [in units of the object], (n,), of points (n, 3) in a collider's frame; above 0 inside."""
    *across, height = collider.size
    if collider.shape == "cylinder":
        sides = [across[0] - np.hypot(points[:, 0], points[:, 1])]
    else:
        sides = [length / 2 - np.abs(points[:, axis]) for axis, length in enumerate(across)]
    depth: Array = np.min([*sides, points[:, 2], height - points[:, 2]], axis=0)
    return depth


def _at(xyz: Array) -> str:
    return "at x {:.2f} m, y {:.2f} m, z {:.2f} m".format(*xyz)


def motion_along(
    stamps_ns: Counts,
    position: Array,
    quaternion_wxyz: Array,
    start_ns: int,
    seconds: float | None = None,
    sweep: int = 0,
) -> Motion:
    """Return the motion of base_link along poses in the world.

    Args:
        stamps_ns: rising, (n,), n >= 2.
        position: (n, 3) [m].
        quaternion_wxyz: unit quaternions (n, 4).
        start_ns: the stamp that becomes time 0; poses before it only shape the splines.
        seconds: end after this time [s]; None for the last pose.
        sweep: steps of the physics behind the end; behind the last pose, the motion goes on as in its last step.

    Raises:
        TrackError: there are no poses at the start.
    """
    first_ns, last_ns = int(stamps_ns[0]), int(stamps_ns[-1])
    count = (last_ns - start_ns) // STEP_NS
    if count < 1 or start_ns + STEP_NS < first_ns:
        raise TrackError(
            f"the poses of the track are from {first_ns / 1e9:.3f} s to {last_ns / 1e9:.3f} s; drive.start_s must be "
            f"between, got {start_ns / 1e9:.3f} s"
        )
    if seconds is not None:
        count = min(count, max(1, round(seconds / STEP_S)))
    count, known = count + sweep, min(count + sweep, (last_ns - start_ns) // STEP_NS)
    times = np.asarray((stamps_ns - start_ns) / 1e9, np.float64)
    steps = np.arange(known + 1, dtype=np.float64) * STEP_S
    positions = CubicSpline(times, position)(steps)
    attitudes = _attitudes(times, quaternion_wxyz, steps)
    # At the stamps of the poses exactly these: the splines round in the last bit.
    rows, rest = np.divmod(stamps_ns - start_ns, STEP_NS)
    own = (rest == 0) & (rows >= 0) & (rows <= known)
    positions[rows[own]], attitudes[rows[own]] = position[own], quaternion_wxyz[own]
    positions, attitudes = _continued(positions, attitudes, count - known)
    turned = np.einsum("ni,ni->n", attitudes[1:], attitudes[:-1]) < 0
    attitudes[1:] *= np.cumprod(np.where(turned, -1.0, 1.0))[:, None]  # q and -q are the same rotation
    turns = Rotation.from_quat(xyzw_from_wxyz(attitudes))
    return Motion(
        stamps_ns=np.arange(1, count + 1, dtype=np.int64) * STEP_NS,
        position=positions[1:],
        quaternion_wxyz=attitudes[1:],
        linear_velocity=np.diff(positions, axis=0) / STEP_S,
        angular_velocity=(turns[1:] * turns[:-1].inv()).as_rotvec() / STEP_S,
    )


def track_along(swept: Motion, rig: Rig) -> Track:
    """Return the track of a motion, which ends with the sweep of the last scan.

    What moves along given poses may have no wheels.
    """
    return Track(motion=swept.first(len(swept.stamps_ns) - sweep_steps(rig)), swept=swept, base=None)


def _attitudes(times: Array, quaternion_wxyz: Array, steps: Array) -> Array:
    """Quaternions wxyz (m, 4) at ``steps`` [s] of a spline through those at ``times`` (n,) [s]."""
    spline = RotationSpline(times, Rotation.from_quat(xyzw_from_wxyz(quaternion_wxyz)))
    blocks = np.split(steps, np.arange(_BLOCK, len(steps), _BLOCK))
    return wxyz_from_xyzw(np.concatenate([spline(block).as_quat() for block in blocks]))


def _continued(positions: Array, attitudes: Array, count: int) -> tuple[Array, Array]:
    """Positions (n, 3) and quaternions wxyz (n, 4) with ``count`` further rows, each moved like the last one."""
    before, last = Rotation.from_quat(xyzw_from_wxyz(attitudes[-2:]))
    numbers = np.arange(1, count + 1)[:, None]
    turned = Rotation.from_rotvec(numbers * (last * before.inv()).as_rotvec()) * last
    moved = positions[-1] + numbers * (positions[-1] - positions[-2])
    return np.concatenate([positions, moved]), np.concatenate([attitudes, wxyz_from_xyzw(turned.as_quat())])
