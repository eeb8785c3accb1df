# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of the robot below the sensors: masses, wheels, outline and limits; by default a Clearpath Husky.

base_link is in the middle of the underside of the chassis; a differential robot's wheels are beside it.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.catalogue import with_robot_model
from fieldtruth.experiment.fields import Frozen, LocatedError, Mount, Number, Positive

WHEELS: Final = ("front_left", "front_right", "rear_left", "rear_right")
GRAVITY: Final = 9.81  # [m/s^2]
MAX_DEFLECTION: Final = 0.2
"""Greatest deflection of a tyre at rest, in radii: beyond, it is flat, and the springs of its tread are no model."""
Inertia = tuple[Positive, Positive, Positive]
Length = Annotated[Number, Field(gt=0, le=2)]


class WheelConfig(Frozen):
    """The driven wheels: four, or with a ``half_wheelbase`` of 0 the two of a differential robot."""

    half_wheelbase: Annotated[Number, Field(ge=0, le=1)] = 0.256  # [m]
    half_track: Annotated[Number, Field(gt=0, le=1)] = 0.2854  # [m]
    axle_height: Number = 0.03282  # [m] above base_link
    radius: Annotated[Number, Field(gt=0, le=1)] = 0.1651  # [m], loaded
    width: Length = 2 * (0.67 / 2 - 0.2854)  # [m]; a Husky's outline ends at the wheels' outer faces
    mass: Positive = 2.637  # [kg]
    inertia: Inertia = (0.02467, 0.04411, 0.02467)  # [kg m^2], principal moments; y is the axle
    tyre_stiffness: Positive = 70_000.0  # [N/m]; see drive.surroundings

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the wheels: of ``WHEELS`` all, or the two at the front."""
        return WHEELS if self.half_wheelbase > 0 else WHEELS[:2]


class CasterConfig(Frozen):
    """A swivel wheel that holds a differential robot level; it rolls and swivels without resistance."""

    x: Number  # [m], from base_link to its axle
    radius: Annotated[Number, Field(gt=0, le=1)]  # [m], loaded
    width: Length  # [m]


class RobotConfig(Frozen):
    """A robot with four driven wheels, or with two and a caster."""

    model: Annotated[str, Field(description="a name from `fieldtruth list robots`")] = "husky"
    """Gives every value below that is not set, from the model's data file."""
    drive: Annotated[Literal["skid_steer", "differential"], Field(description="skid_steer or differential")] = (
        "skid_steer"
    )
    mass: Annotated[Number, Field(gt=0, le=2000)] = 50.0  # [kg], with wheels
    chassis_centre: tuple[Number, Number, Number] = (-0.00065, 0.0, 0.062)  # [m], of mass, in base_link
    chassis_inertia: Inertia = (0.6022, 1.7386, 2.0296)  # [kg m^2], principal moments along x, y, z ...
    chassis_inertia_mass: Positive = 46.034  # [kg], ... of a chassis of this mass; they grow with the chassis's mass
    wheels: WheelConfig = WheelConfig()
    caster: CasterConfig | None = None
    outline: tuple[Length, Length, Length] = (0.99, 0.67, 0.39)  # [m]: length, width, height above the ground
    chassis_width: Length = 0.5709  # [m], between the wheels
    deck_height: Length | None = None
    """Height [m] of the chassis's upper side above the ground. None: that of the outline."""
    base_footprint: Mount | None = None
    """Frame on the ground below base_link. None: at the height of the wheels' lowest points."""
    max_torque: Positive = 40.0  # [N m] of one wheel
    max_acceleration: Positive = 3.0  # [m/s^2]
    max_turn_acceleration: Positive = 6.0  # [rad/s^2]
    max_speed: Annotated[Number, Field(gt=0, le=10)] = 1.0  # [m/s]
    max_turn_rate: Positive = 2.0  # [rad/s]

    @model_validator(mode="before")
    @classmethod
    def _completed(cls, given: Any) -> Any:
        if isinstance(given, str):
            given = {"model": given}
        if not isinstance(given, Mapping) or not isinstance(given.get("model"), str):
            return given
        return with_robot_model(given)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        differential, w = self.drive == "differential", self.wheels
        if differential != (w.half_wheelbase == 0):
            what = "0 of a differential robot" if differential else "above 0 of a skid_steer robot"
            raise LocatedError(f"must be {what}, got {w.half_wheelbase:g}", ("wheels", "half_wheelbase"))
        if differential != (self.caster is not None):
            what = "is required of" if differential else "must not be given for"
            raise LocatedError(f"{what} a {self.drive} robot: {{x: ..., radius: ..., width: ...}}", ("caster",))
        if len(w.names) * w.mass >= self.mass:
            raise LocatedError(
                f"must be above {len(w.names) * w.mass:g}, that of the wheels, got {self.mass:g}", ["mass"]
            )
        for moments, at in ((self.chassis_inertia, ("chassis_inertia",)), (w.inertia, ("wheels", "inertia"))):
            if 2 * max(moments) > sum(moments):
                raise LocatedError(f"must have no value above the sum of the others, got {list(moments)}", at)
        self._check_support()
        return self

    def _check_support(self) -> None:
        w = self.wheels
        ends = sorted((self.caster.x, 0.0)) if self.caster else [-w.half_wheelbase, w.half_wheelbase]
        (x, y, _), least = self.chassis_centre, self.mass * GRAVITY / len(w.names) / (MAX_DEFLECTION * w.radius)
        if not (ends[0] < x < ends[1] and abs(y) < w.half_track):
            what = f"must be between the wheels, x {ends[0]:g} to {ends[1]:g} m, y up to {w.half_track:g} m"
            raise LocatedError(f"{what}, got {[x, y]}", ["chassis_centre"])
        if self.ground_clearance <= 0:
            what = f"must be below the radius {w.radius:g}, as the chassis is above the ground"
            raise LocatedError(f"{what}, got {w.axle_height:g}", ("wheels", "axle_height"))
        if w.tyre_stiffness < least:
            what = f"must be at least {least:.0f}, so that a tyre carries its share of {self.mass:g} kg"
            raise LocatedError(f"{what}, got {w.tyre_stiffness:g}", ("wheels", "tyre_stiffness"))

    @property
    def footprint(self) -> Mount:
        """The frame base_footprint."""
        return self.base_footprint or Mount(xyz=(0.0, 0.0, round(self.wheels.axle_height - self.wheels.radius, 9)))

    @property
    def ground_clearance(self) -> float:
        """Height [m] of base_link and of the chassis above the plane through the wheels' contact points."""
        return -self.footprint.xyz[2]

    @property
    def chassis_top(self) -> float:
        """Height [m] of the chassis's upper side above base_link."""
        return (self.deck_height or self.outline[2]) - self.ground_clearance

    @property
    def chassis_mass(self) -> float:
        """Mass [kg] without the wheels."""
        return self.mass - len(self.wheels.names) * self.wheels.mass

    @property
    def chassis_moments(self) -> Array:
        """Principal moments of inertia (3,) [kg m^2] of the chassis with its mass."""
        return np.array(self.chassis_inertia) * (self.chassis_mass / self.chassis_inertia_mass)

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """Contact points x, y [m] in base_link: front left, front right, rear left, rear right.

        Of a differential robot the caster is the two that have no wheel.
        """
        a, b = self.wheels.half_wheelbase, self.wheels.half_track
        if self.caster is None:
            return (a, b), (a, -b), (-a, b), (-a, -b)
        return (0.0, b), (0.0, -b), (self.caster.x, 0.0), (self.caster.x, 0.0)

    @property
    def caster_share(self) -> float:
        """Share of the weight on the caster."""
        if self.caster is None:
            return 0.0
        return self.chassis_centre[0] * self.chassis_mass / self.mass / self.caster.x
