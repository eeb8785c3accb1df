# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Social forces: accelerations by which walkers keep away from each other, from walls, and near their group.

Model and numbers, which were fitted to people in a corridor: Moussaid et al. 2009 (Experimental study of the
behavioural mechanisms underlying self-organization in human crowds, Proc. R. Soc. B 276, 2755-2762). Groups: Moussaid
et al. 2010 (The walking behaviour of pedestrian social groups and its impact on crowd dynamics, PLoS ONE 5(4), e10047).
As these are people of about half a metre, distances between others are reduced to those of two people with the same
gap.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Index, Mask

RELAXATION: Final = 0.54
"""Time [s] in which a free walker comes to its speed: v0 (1 - exp(-t / RELAXATION))."""
_STRENGTH: Final = 4.5  # [m/s2]
_RANGE: Final = 0.35  # [m]
_RELATIVE: Final = 2.0  # weight [s] of the relative velocity against the direction to the other
_SLOW, _TURN = 3.0, 2.0  # narrowness of the angles in which they slow down, and turn away
_WALL: Final = 3.0  # [m/s2]
_WALL_RANGE: Final = 0.1  # [m]
_PERSON: Final = 0.5  # [m] between the middles of two people who touch
_RIGHT: Final = 0.05  # [rad]; who meets another one exactly head-on turns to the right
_ASIDE: Final = 3.0  # [m/s2] at most, away from the line of another one
_SOON: Final = 2.5  # [s] before they would touch
_ROOM: Final = 0.4  # [m] between two who pass
_RIGHT_OF: Final = 0.2  # [m]
_WAIT: Final = (-0.4, 0.3)
_GAZE, _COHESION, _PUSH = 4.0, 3.0, 1.0  # [m/s2]; the first for each m/s and rad


def _unit(vectors: Array) -> tuple[Array, Array]:
    """Directions of vectors (..., 2), and their lengths (...)."""
    length = np.hypot(vectors[..., 0], vectors[..., 1])
    return vectors / np.maximum(length, 1e-9)[..., None], length


def away_from_others(
    position: Array, velocity: Array, others: tuple[Array, Array], touching: Array, itself: Mask
) -> Array:
    """Return the accelerations (n, 2) of walkers because of others.

    Args:
        position: of walkers (n, 2) [m].
        velocity: of walkers (n, 2) [m/s].
        others: positions and velocities (m, 2).
        touching: distances (n, m) [m] of the middles of two that touch.
        itself: (n, m), which of the others is the walker itself, or does not count.
    """
    direction, distance = _unit(others[0] - position[:, None])
    towards, strength = _unit(_RELATIVE * (velocity[:, None] - others[1]) + direction)
    reach = _RANGE * np.maximum(strength, 1e-3)
    cross = towards[..., 0] * direction[..., 1] - towards[..., 1] * direction[..., 0]
    angle = np.arctan2(cross, (towards * direction).sum(axis=-1)) + _RIGHT  # of the other one, to the left of it
    gap = np.maximum(distance - touching + _PERSON, 0.0)
    slow = -_STRENGTH * np.exp(-gap / reach - (_SLOW * reach * angle) ** 2)
    turn = -_STRENGTH * np.sign(angle) * np.exp(-gap / reach - (_TURN * reach * angle) ** 2)
    slow[itself] = turn[itself] = 0.0
    left = np.stack([-towards[..., 1], towards[..., 0]], axis=-1)
    return np.asarray((slow[..., None] * towards + turn[..., None] * left).sum(axis=1))


def out_of_the_way(
    position: Array, intended: Array, others: tuple[Array, Array], touching: Array, itself: Mask
) -> Array:
    """Return the accelerations (n, 2) of walkers out of the way of others that they would touch soon.

    The model above is too weak for those whom curves and headings keep from steps aside, and for robots, which do not
    give way. They pass on the side on which the other one is farther, else on the right. ``intended`` (n, 2) [m/s] is
    where they are going; other arguments as in ``away_from_others``.
    """
    ahead, speed = _unit(intended[:, None] - others[1])
    offset = others[0] - position[:, None]
    along = (offset * ahead).sum(axis=-1)
    miss = ahead[..., 0] * offset[..., 1] - ahead[..., 1] * offset[..., 0]  # to the left of the other one
    soon = (speed > 0.2) & (along > 0) & (along - touching < _SOON * speed) & ~itself
    strength = _ASIDE * soon * np.clip((touching + _ROOM - np.abs(miss)) / _ROOM, 0.0, 1.0)
    side = np.where(miss < -_RIGHT_OF, strength, -strength)[..., None]
    return np.asarray((side * np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)).sum(axis=1))


def away_from_walls(gap: Array, outwards: Array) -> Array:
    """Return the accelerations (n, 2) for gaps (n,) [m] to what blocks, and directions (n, 2) away from it."""
    return _WALL * np.exp(-np.maximum(gap, 0.0) / _WALL_RANGE)[:, None] * outwards


def towards_group(position: Array, velocity: Array, pace: Array, radius: Array, members: Index) -> Array:
    """Return the accelerations (m, 2) of the ``members`` (m,), two or more, of one group of walkers.

    They change the ``pace`` [m/s] by the shares of ``_WAIT`` at most: who cannot step aside or back would wait for one
    behind who cannot pass.
    """
    own, count = position[members], len(members)
    rest = (own.sum(axis=0) - own) / (count - 1)  # the middle of the others, who should be in sight
    heading, speed = _unit(velocity[members])
    cosine = (heading * _unit(rest - own)[0]).sum(axis=1)
    behind = np.maximum(np.arccos(np.clip(cosine, -1.0, 1.0)) - np.pi / 2, 0.0)
    force = -_GAZE * (behind * speed)[:, None] * heading
    direction, distance = _unit(own.mean(axis=0) - own)
    force += _COHESION * (distance > (count - 1) / 2 + radius[members] - _PERSON / 2)[:, None] * direction
    between, apart = _unit(own[:, None] - own)
    close = apart < radius[members][:, None] + radius[members] + 0.1
    np.fill_diagonal(close, val=False)
    force += _PUSH * (close[..., None] * between).sum(axis=1)
    along, limit = (force * heading).sum(axis=1), pace[members] / RELAXATION
    return np.asarray(force + (np.clip(along, _WAIT[0] * limit, _WAIT[1] * limit) - along)[:, None] * heading)


def speed_behind(
    position: Array, heading: Array, braking: Array, others: tuple[Array, Array], touching: Array, itself: Mask
) -> Array:
    """Return the speeds (n,) [m/s] from which walkers can stop before they touch others; infinite with none ahead.

    ``heading`` (n, 2) are directions, ``braking`` (n,) [m/s2]. Who comes nearer gets half of the gap between the two.
    """
    offset = others[0] - position[:, None]
    along = (offset * heading[:, None]).sum(axis=-1)
    across = np.abs(heading[:, None, 0] * offset[..., 1] - heading[:, None, 1] * offset[..., 0])
    reach = touching + 0.05
    gap = np.maximum(along - np.sqrt(np.maximum(reach**2 - across**2, 0.0)), 0.0)
    away = (heading[:, None] * others[1]).sum(axis=-1)
    speed = np.maximum(away, 0.0) + np.sqrt(2 * braking[:, None] * np.where(away < 0, gap / 2, gap))
    speed[(across >= reach) | (along <= 0)] = np.inf
    # Where two brush past each other, the speed along the line between them counts.
    direction, distance = _unit(offset)
    share = (direction * heading[:, None]).sum(axis=-1)
    away = np.maximum((direction * others[1]).sum(axis=-1), 0.0)
    aside = (away + np.sqrt(2 * braking[:, None] * np.maximum(distance - touching - 0.03, 0.0))) / np.maximum(
        share, 1e-3
    )
    speed = np.minimum(speed, np.where(share > 0, aside, np.inf))
    speed[itself] = np.inf
    return np.asarray(speed.min(axis=1, initial=np.inf))
