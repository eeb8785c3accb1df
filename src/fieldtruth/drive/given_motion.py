# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Motion along given poses instead of a simulated drive.

Positions follow a cubic spline through the poses, orientations SciPy's rotation spline: velocity, turn rate and their
derivatives are continuous. The rate of the physics samples both; velocity and turn rate are those of the step that ends
at the stamp, as in the physics (``sensors.imu.sensing``). So their sums over all steps are the path and the attitude,
and the IMU of a track that was recorded from the physics reads what it read there. A noisy file makes a noisy IMU.
"""

from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.errors import TrackError
from fieldtruth.core.transforms import wxyz_from_xyzw, xyzw_from_wxyz
from fieldtruth.drive.physics import STEP_NS, STEP_S
from fieldtruth.drive.readings import sweep_steps
from fieldtruth.drive.track import Motion, Track
from fieldtruth.experiment.rig import Rig

_BLOCK: Final = 100_000
"""Rows that the rotation spline computes at once; it takes half a kilobyte for each."""


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
    places = CubicSpline(times, position)(steps)
    attitudes = _attitudes(times, quaternion_wxyz, steps)
    # At the stamps of the poses exactly these: the splines round in the last bit.
    rows, rest = np.divmod(stamps_ns - start_ns, STEP_NS)
    own = (rest == 0) & (rows >= 0) & (rows <= known)
    places[rows[own]], attitudes[rows[own]] = position[own], quaternion_wxyz[own]
    places, attitudes = _continued(places, attitudes, count - known)
    turned = np.einsum("ni,ni->n", attitudes[1:], attitudes[:-1]) < 0
    attitudes[1:] *= np.cumprod(np.where(turned, -1.0, 1.0))[:, None]  # q and -q are the same rotation
    turns = Rotation.from_quat(xyzw_from_wxyz(attitudes))
    return Motion(
        stamps_ns=np.arange(1, count + 1, dtype=np.int64) * STEP_NS,
        position=places[1:],
        quaternion_wxyz=attitudes[1:],
        linear_velocity=np.diff(places, axis=0) / STEP_S,
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


def _continued(places: Array, attitudes: Array, count: int) -> tuple[Array, Array]:
    """Positions (n, 3) and quaternions wxyz (n, 4) with ``count`` further rows, each moved like the last one."""
    before, last = Rotation.from_quat(xyzw_from_wxyz(attitudes[-2:]))
    numbers = np.arange(1, count + 1)[:, None]
    turned = Rotation.from_rotvec(numbers * (last * before.inv()).as_rotvec()) * last
    moved = places[-1] + numbers * (places[-1] - places[-2])
    return np.concatenate([places, moved]), np.concatenate([attitudes, wxyz_from_xyzw(turned.as_quat())])
