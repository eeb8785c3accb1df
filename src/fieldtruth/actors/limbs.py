# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Limbs: motion of a body as its gait has seen it, inverse kinematics of legs, and feet that step and do not slip."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from fieldtruth.actors.figure import STEP, Ground, Placement

_MEMORY: Final = 0.06
"""[s] in which velocities are smoothed."""
_CLOSE, _ALIGNED = 0.04, 0.15
"""[m] and [rad] of a foot's place to where it would step at which it stays."""
_MOST_TURN: Final = 0.9
"""[rad] of a body that turns in a stride."""
Point = tuple[float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]
"""Rotation, row by row."""


def ease(share: float) -> float:
    """Return a smooth step from 0 to 1 of a share, which may be outside of 0 to 1."""
    s = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
    return s * s * (3.0 - 2.0 * s)


def softest(values: Sequence[float], blend: float) -> float:
    """Return a smooth minimum, at most the least value."""
    least = min(values)
    return least - blend * math.log(sum(math.exp((least - v) / blend) for v in values))


def turned(yaw: float, pitch: float, roll: float) -> Matrix:
    """Return the rotation about z, then the new y, then the new x [rad]."""
    a, b, c, d, e, f = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch), math.cos(roll), math.sin(roll)
    return a * c, a * d * f - b * e, a * d * e + b * f, b * c, b * d * f + a * e, b * d * e - a * f, -d, c * f, c * e


def pitched(m: Matrix, angle: float) -> Matrix:
    """Return a rotation that is followed by one about the new y [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return (m[0] * c - m[2] * s, m[1], m[0] * s + m[2] * c, m[3] * c - m[5] * s, m[4], m[3] * s + m[5] * c,
        m[6] * c - m[8] * s, m[7], m[6] * s + m[8] * c)  # fmt: skip


def times(m: Matrix, n: Matrix) -> Matrix:
    """Return the product of two rotations."""
    a, b, c, d, e, f, g, h, i = m
    j, k, l, o, p, q, r, s, t = n  # noqa: E741
    return (
        a * j + b * o + c * r,
        a * k + b * p + c * s,
        a * l + b * q + c * t,
        d * j + e * o + f * r,
        d * k + e * p + f * s,
        d * l + e * q + f * t,
        g * j + h * o + i * r,
        g * k + h * p + i * s,
        g * l + h * q + i * t,
    )


def transposed(m: Matrix) -> Matrix:
    """Return the inverse of a rotation."""
    return m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]


def applied(m: Matrix, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a vector that a rotation turns."""
    return m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z


def two_links(x: float, z: float, upper: float, lower: float, bend: float) -> tuple[float, float]:
    """Return the angles [rad] about y of two links that hang along -z and end at x, z [m] of their root.

    ``bend`` is 1 for a knee, whose lower link turns to the back, and -1 for an elbow. Bent by 6 deg at least,
    they point at what is too far.
    """
    far = min(max(math.hypot(x, z), abs(upper - lower) + 1e-6), 0.9985 * (upper + lower))
    inner = math.acos((upper * upper + far * far - lower * lower) / (2.0 * upper * far))
    knee = math.acos((upper * upper + lower * lower - far * far) / (2.0 * upper * lower))
    return math.atan2(-x, -z) - bend * inner, bend * (math.pi - knee)


class Motion:
    """Where an actor is, and how it moves: from its placements up to now."""

    def __init__(self, placement: Placement) -> None:
        self.x, self.y, self.heading = placement.x, placement.y, placement.heading
        self.vx, self.vy = placement.speed * math.cos(self.heading), placement.speed * math.sin(self.heading)
        """[m/s] in the world, smoothed."""
        self.turn = 0.0
        """[rad/s] about z, smoothed."""
        self.speed = placement.speed
        """[m/s] along the heading, smoothed."""
        self.rolled = 0.0
        """[m] along the heading since the last knot."""
        self._started = False

    def follow(self, placement: Placement) -> None:
        """Move to the next placement; the first one is where it stands already."""
        share = STEP / (_MEMORY + STEP) if self._started else 0.0
        self._started = True
        dx, dy = placement.x - self.x, placement.y - self.y
        around = math.remainder(placement.heading - self.heading, math.tau)
        middle = self.heading + around / 2
        self.rolled = dx * math.cos(middle) + dy * math.sin(middle)
        self.x, self.y, self.heading = placement.x, placement.y, self.heading + around
        self.vx += share * (dx / STEP - self.vx)
        self.vy += share * (dy / STEP - self.vy)
        self.turn += share * (around / STEP - self.turn)
        self.speed = self.vx * math.cos(self.heading) + self.vy * math.sin(self.heading)


class Rhythm(NamedTuple):
    """How feet step at a speed."""

    frequency: float
    """[Hz] of strides: two steps of a biped."""
    duty: float
    """Share of a stride in which a foot carries."""
    lift: float
    """[m] by which a foot rises."""
    lead: float = 0.45
    """Share of the time on the ground in which the foot is ahead of its rest."""


class Foot:
    """A foot: on the ground, where it stays, or in the air. ``x``, ``y``, ``z`` [m]: of its sole below the ankle."""

    __slots__ = (
        "carries",
        "offset",
        "out",
        "pitch",
        "rest_x",
        "rest_y",
        "roll",
        "share",
        "since",
        "span",
        "start",
        "turns",
        "x",
        "y",
        "yaw",
        "z",
    )

    def __init__(self, rest: tuple[float, float], offset: float, out: float = 0.0) -> None:
        self.rest_x, self.rest_y = rest
        """[m] in the root's frame where it rests when the body stands."""
        self.offset, self.out = offset, out
        """Share of a stride by which it is early, and [rad] by which it points to the left."""
        self.carries, self.share, self.since, self.span, self.turns = True, 1.0, 1.0, 1.0, 0
        """``share`` of the step that is done, which takes ``span`` [s]; ``since`` [s] it carries."""
        self.x = self.y = self.z = self.yaw = self.pitch = self.roll = 0.0
        self.start = (0.0, 0.0, 0.0)


class Steps:
    """Feet that step in turns, each by its part of the stride. One that carries does not move."""

    def __init__(
        self, feet: Sequence[Foot], motion: Motion, ground: Ground, sole: tuple[float, float, float], rhythm: Rhythm
    ) -> None:
        """Put the feet where they rest, or where they are in the middle of a walk.

        Args:
            feet: of one body.
            motion: of the body.
            ground: heights.
            sole: [m] from the ankle to the heel (below 0) and to the ball of the foot, and the width; zeros: a point.
            rhythm: in which the body walks at first.
        """
        self.feet, self.motion, self._sole = feet, motion, sole
        self.phase = -1e-9  # so that the first foot rises at once
        """Strides since it last stood."""
        moves = math.hypot(motion.vx, motion.vy) > 0.05
        for foot in feet:
            since, air = (foot.offset or 1.0), 1.0 - rhythm.duty
            if moves and since < air:
                foot.carries, foot.share, foot.span = False, since / air, air / rhythm.frequency
                since += 1.0
            after = (rhythm.lead * rhythm.duty - since + air) / rhythm.frequency
            self._put(ground, foot, *self._landing(foot, after if moves else 0.0))
            foot.start, foot.turns = (foot.x, foot.y, foot.yaw), math.floor(self.phase + foot.offset)

    def step(self, rhythm: Rhythm, ground: Ground) -> None:
        """Move the feet to the next knot."""
        frequency = max(rhythm.frequency, abs(self.motion.turn) / _MOST_TURN)
        ahead = rhythm.lead * rhythm.duty / frequency
        self.phase += frequency * STEP
        busy = False
        for foot in self.feet:
            if not foot.carries:
                busy = True
                self._swing(foot, ground, rhythm, ahead)
                continue
            foot.since += STEP
            turns = math.floor(self.phase + foot.offset)
            if turns > foot.turns:
                foot.turns = turns
                if self._wants(foot, ahead):
                    busy = True
                    self.lift(foot, (1.0 - rhythm.duty) / frequency)
        if not busy and not any(self._wants(foot, ahead) for foot in self.feet):
            self._wait()

    def _wait(self) -> None:
        """Stand, so that the first foot rises at once when it has to."""
        self.phase = -1e-9
        for foot in self.feet:
            foot.turns = math.floor(self.phase + foot.offset)

    def lift(self, foot: Foot, span: float) -> None:
        """Begin a step that takes a time [s]."""
        foot.carries, foot.share, foot.span, foot.start = False, 0.0, span, (foot.x, foot.y, foot.yaw)

    def _wants(self, foot: Foot, ahead: float) -> bool:
        x, y, yaw = self._landing(foot, ahead)
        return math.hypot(x - foot.x, y - foot.y) > _CLOSE or abs(math.remainder(yaw - foot.yaw, math.tau)) > _ALIGNED

    def _swing(self, foot: Foot, ground: Ground, rhythm: Rhythm, ahead: float) -> None:
        foot.share = min(foot.share + STEP / foot.span, 1.0)
        x, y, yaw = self._landing(foot, ahead + (1.0 - foot.share) * foot.span)
        even = max(0.9 - 1.5 * rhythm.duty, 0.25)  # a foot does not halt in the air
        s, (x0, y0, yaw0) = ease(foot.share) + even * (foot.share - ease(foot.share)), foot.start
        self._put(ground, foot, x0 + s * (x - x0), y0 + s * (y - y0), yaw0 + s * math.remainder(yaw - yaw0, math.tau))
        foot.z += 16.0 * rhythm.lift * (foot.share * (1.0 - foot.share)) ** 2 * (1.5 - foot.share)
        if foot.share >= 1.0:
            foot.carries, foot.since = True, 0.0
            foot.turns = max(foot.turns, math.floor(self.phase + foot.offset))

    def _landing(self, foot: Foot, after: float) -> tuple[float, float, float]:
        """Return where a foot rests, and its yaw, if the body goes on for a time [s] as it does now."""
        motion = self.motion
        around = min(max(motion.turn * after, -1.0), 1.0)
        c, s = math.cos(around / 2) * after, math.sin(around / 2) * after
        heading = motion.heading + around
        ch, sh = math.cos(heading), math.sin(heading)
        x = motion.x + motion.vx * c - motion.vy * s + ch * foot.rest_x - sh * foot.rest_y
        y = motion.y + motion.vx * s + motion.vy * c + sh * foot.rest_x + ch * foot.rest_y
        return x, y, heading + foot.out

    def _put(self, ground: Ground, foot: Foot, x: float, y: float, yaw: float) -> None:
        """Lay the sole on the ground at x, y [m]."""
        heel, ball, width = self._sole
        foot.x, foot.y, foot.yaw = x, y, yaw
        if not width:
            foot.z = ground(x, y)
            return
        c, s = math.cos(yaw), math.sin(yaw)
        low, high = ground(x + heel * c, y + heel * s), ground(x + ball * c, y + ball * s)
        foot.z = low + (high - low) * heel / (heel - ball)
        side = ground(x - width * s, y + width * c)
        foot.pitch, foot.roll = -math.atan2(high - low, ball - heel), math.atan2(side - foot.z, width)
