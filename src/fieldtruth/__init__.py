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

    from fieldtruth.bag.damage import BagError
    from fieldtruth.bag.readings import Reading, count_messages, read_bag
    from fieldtruth.core import frames, geodesy
    from fieldtruth.core.classes import CLASSES, NO_RETURN, PALETTE, Label, SemanticClass
    from fieldtruth.core.errors import (
        ConfigurationError,
        DriveError,
        EngineError,
        FieldtruthError,
        OutputError,
        RouteError,
        UnknownNameError,
    )
    from fieldtruth.core.progress import Progress, show_progress
    from fieldtruth.drive.plan import plan_route
    from fieldtruth.drive.track import Track
    from fieldtruth.experiment.catalogue import list_environments, list_experiments
    from fieldtruth.experiment.config import (
        ControlConfig,
        Experiment,
        LightConfig,
        MetresRouteConfig,
        RandomRouteConfig,
        RouteConfig,
    )
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
    from fieldtruth.experiment.route import random_route, route_from_metres, route_yaml
    from fieldtruth.pipeline import generate
    from fieldtruth.render import BakedScene, Camera, CameraImages, bake
    from fieldtruth.report.preview import preview
    from fieldtruth.report.shares import ClassShares, class_shares
    from fieldtruth.sense import LabelCamera, LabelImages, Lidar, Scan, Scene, tag_image
    from fieldtruth.world import World, load_world

    __version__ = version("fieldtruth")

_HOMES: Final = {
    "core.classes": "CLASSES NO_RETURN PALETTE Label SemanticClass",
    "drive.plan": "plan_route",
    "drive.track": "Track",
    "core.errors": "ConfigurationError DriveError EngineError FieldtruthError OutputError RouteError UnknownNameError",
    "experiment.catalogue": "list_environments list_experiments",
    "experiment.config": "ControlConfig Experiment LightConfig MetresRouteConfig RandomRouteConfig RouteConfig",
    "experiment.files": "dump_experiment load_experiment parse_experiment with_overrides",
    "experiment.rig": "OPTICAL CameraConfig GnssConfig ImuConfig LidarConfig Mount Rig TachometerConfig WheelConfig",
    "experiment.route": "random_route route_from_metres route_yaml",
    "pipeline": "generate",
    "bag.readings": "Reading count_messages read_bag",
    "bag.damage": "BagError",
    "report.preview": "preview",
    "core.progress": "Progress show_progress",
    "report.shares": "ClassShares class_shares",
    "render": "BakedScene Camera CameraImages bake",
    "sense": "LabelCamera LabelImages Lidar Scan Scene tag_image",
    "world": "World load_world",
}
_MODULES: Final = ("frames", "geodesy")
_MODULE_OF: Final = {name: f"fieldtruth.{module}" for module, names in _HOMES.items() for name in names.split()}

__all__ = [
    "CLASSES",
    "NO_RETURN",
    "OPTICAL",
    "PALETTE",
    "BagError",
    "BakedScene",
    "Camera",
    "CameraConfig",
    "CameraImages",
    "ClassShares",
    "ConfigurationError",
    "ControlConfig",
    "DriveError",
    "EngineError",
    "Experiment",
    "FieldtruthError",
    "GnssConfig",
    "ImuConfig",
    "Label",
    "LabelCamera",
    "LabelImages",
    "Lidar",
    "LidarConfig",
    "LightConfig",
    "MetresRouteConfig",
    "Mount",
    "OutputError",
    "Progress",
    "RandomRouteConfig",
    "Reading",
    "Rig",
    "RouteConfig",
    "RouteError",
    "Scan",
    "Scene",
    "SemanticClass",
    "TachometerConfig",
    "Track",
    "UnknownNameError",
    "WheelConfig",
    "World",
    "__version__",
    "bake",
    "class_shares",
    "count_messages",
    "dump_experiment",
    "frames",
    "generate",
    "geodesy",
    "list_environments",
    "list_experiments",
    "load_experiment",
    "load_world",
    "parse_experiment",
    "plan_route",
    "preview",
    "random_route",
    "read_bag",
    "route_from_metres",
    "route_yaml",
    "show_progress",
    "tag_image",
    "with_overrides",
]


def __getattr__(name: str) -> Any:
    if name in _MODULE_OF:
        value = getattr(import_module(_MODULE_OF[name]), name)
    elif name in _MODULES:
        value = import_module(f"fieldtruth.core.{name}")
    elif name == "__version__":
        value = import_module("importlib.metadata").version("fieldtruth")
    else:
        raise AttributeError(f"module 'fieldtruth' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
