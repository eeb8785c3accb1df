# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The kinds of actors by the names that experiments have for them."""

from collections.abc import Mapping
from typing import Final

from fieldtruth.actors.animals import COW, DEER, DOG, WINTER_DEER, AnimalKind
from fieldtruth.actors.cyclist import CyclistKind
from fieldtruth.actors.figure import Kind
from fieldtruth.actors.multirotor import MultirotorKind
from fieldtruth.actors.person import PersonKind
from fieldtruth.actors.vehicles import VehicleKind

KINDS: Final[Mapping[str, Kind]] = {
    "person": PersonKind(),
    "dog": AnimalKind("dog", DOG),
    "deer": AnimalKind("deer", DEER),
    "cow": AnimalKind("cow", COW),
    "cyclist": CyclistKind(),
    "car": VehicleKind("car"),
    "tractor": VehicleKind("tractor"),
    "robot": VehicleKind("robot"),
    "multirotor": MultirotorKind(),
}
IN_WINTER_COAT: Final[Mapping[str, Kind]] = {"deer": AnimalKind("deer", WINTER_DEER)}
"""Of kinds that look otherwise outside summer."""
