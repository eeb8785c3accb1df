# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Automatically annotated data sets of a ground robot in natural environments.

Everything public is here, flat: ``import fieldtruth as ft`` and nothing else. A name's module is imported when the name
is first used (PEP 562), so that what is not needed costs no time.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from importlib.metadata import version

    from fieldtruth import frames, geodesy
    from fieldtruth.classes import CLASSES, NO_RETURN, PALETTE, Label, SemanticClass
    from fieldtruth.errors import (
        ConfigurationError,
        DriveError,
        EngineError,
        FieldtruthError,
        OutputError,
        UnknownNameError,
    )
    from fieldtruth.experiment.catalogue import list_environments, list_experiments
    from fieldtruth.experiment.config import ControlConfig, Experiment, LightConfig, RouteConfig
    from fieldtruth.experiment.files import dump_experiment, load_experiment, parse_experiment, with_overrides
    from fieldtruth.experiment.rig import (
        OPTICAL,
        CameraConfig,
        GnssConfig,
        ImuConfig,
        LidarConfig,
        Mount,
        Rig,
        TachometerConfig,
        WheelConfig,
    )
    from fieldtruth.experiment.route import route_from_metres, route_yaml

    __version__ = version("fieldtruth")

_HOMES: Final = {
    "classes": "CLASSES NO_RETURN PALETTE Label SemanticClass",
    "errors": "ConfigurationError DriveError EngineError FieldtruthError OutputError UnknownNameError",
    "experiment.catalogue": "list_environments list_experiments",
    "experiment.config": "ControlConfig Experiment LightConfig RouteConfig",
    "experiment.files": "dump_experiment load_experiment parse_experiment with_overrides",
    "experiment.rig": "OPTICAL CameraConfig GnssConfig ImuConfig LidarConfig Mount Rig TachometerConfig WheelConfig",
    "experiment.route": "route_from_metres route_yaml",
}
_MODULES: Final = ("frames", "geodesy")
_MODULE_OF: Final = {name: f"fieldtruth.{module}" for module, names in _HOMES.items() for name in names.split()}

__all__ = [
    "CLASSES",
    "NO_RETURN",
    "OPTICAL",
    "PALETTE",
    "CameraConfig",
    "ConfigurationError",
    "ControlConfig",
    "DriveError",
    "EngineError",
    "Experiment",
    "FieldtruthError",
    "GnssConfig",
    "ImuConfig",
    "Label",
    "LidarConfig",
    "LightConfig",
    "Mount",
    "OutputError",
    "Rig",
    "RouteConfig",
    "SemanticClass",
    "TachometerConfig",
    "UnknownNameError",
    "WheelConfig",
    "__version__",
    "dump_experiment",
    "frames",
    "geodesy",
    "list_environments",
    "list_experiments",
    "load_experiment",
    "parse_experiment",
    "route_from_metres",
    "route_yaml",
    "with_overrides",
]


def __getattr__(name: str) -> Any:
    if name in _MODULE_OF:
        value = getattr(import_module(_MODULE_OF[name]), name)
    elif name in _MODULES:
        value = import_module(f"fieldtruth.{name}")
    elif name == "__version__":
        value = import_module("importlib.metadata").version("fieldtruth")
    else:
        raise AttributeError(f"module 'fieldtruth' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
