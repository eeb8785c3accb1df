# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sub-commands for worlds, also in other tools, for rigs and the cache: world, scene, map, gazebo, rig, cache."""

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fieldtruth.cli.arguments import UsageError, chosen
from fieldtruth.cli.terminal import print_line, print_output
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.core.files import output_path
from fieldtruth.core.progress import show_progress
from fieldtruth.experiment.environment_file import is_environment_file, world_name

if TYPE_CHECKING:
    from fieldtruth.core.cache_folder import Entry
    from fieldtruth.experiment.config import Experiment
    from fieldtruth.world.model import World


def selected_world(options: argparse.Namespace, *layouts: Mapping[str, Any]) -> "World":
    """Load the world that the arguments select; layouts as in ``chosen``."""
    from fieldtruth.world.build import load_world

    environment, layout = chosen(options, *layouts)
    return load_world(environment, options.seed, layout)


def _world(options: argparse.Namespace) -> None:
    from fieldtruth.world.build import load_world
    from fieldtruth.world.environments import FROM_FILES

    environment, layout = chosen(options)
    with show_progress() as progress:
        notes: list[str] = []
        if environment in FROM_FILES:
            from fieldtruth.world.environments.site.inputs import describe, inputs_of

            with progress.stage("read the maps"):
                notes = list(describe(*inputs_of(layout)))
        world = load_world(environment, options.seed, layout, progress=progress)
    latitude, longitude, height = world.origin
    triangles = sum(len(world.meshes[each.mesh].faces) for each in world.instances)
    print(f"{world.name}: {world.size[0]:g} m x {world.size[1]:g} m about {latitude:.7f}, {longitude:.7f}")
    print(f"origin: {height:.3f} m above the ellipsoid of WGS 84; z = 0 there")
    for line in notes:
        print(line)
    print_line(
        f"world: {len(world.instances):,} objects of {triangles / 1e6:.1f} million triangles, "
        f"{len(world.swarms)} swarms; seed {world.seed}"
    )


def _scene(options: argparse.Namespace) -> None:
    from fieldtruth.interchange import check_scene_output, write_scene

    out = check_scene_output(
        f"{world_name(options.environment)}_{options.seed}", options.out, to=options.to, overwrite=options.overwrite
    )
    with show_progress() as progress:
        with progress.stage("build the world"):
            world = selected_world(options)
        with progress.stage("write the scene"):
            write_scene(world, out, to=options.to, beyond=not options.no_beyond, overwrite=options.overwrite)
    print_output(out)


def _map(options: argparse.Namespace) -> None:
    _, layouts, stem = _selected(options)
    from fieldtruth.world_maps import check_layers, check_map, write_map

    check_map(stem, options.out, to=options.to, overwrite=options.overwrite)
    check_layers(options.layers, options.resolution, options.to)
    asked = {key: getattr(options, key) for key in ("to", "resolution", "layers", "area", "overwrite", "workers")}
    with show_progress() as progress:
        with progress.stage("build the world"):
            world = selected_world(options, *layouts)
        out = write_map(world, options.out, **asked, progress=progress)
    print_output(out)


def _cost(options: argparse.Namespace) -> None:
    like, layouts, stem = _selected(options)
    from fieldtruth.cost import check_cost, check_cost_output, write_cost_map
    from fieldtruth.experiment.catalogue import ROBOTS
    from fieldtruth.experiment.rig import Rig

    if options.robot is not None and options.robot not in ROBOTS:
        raise UnknownNameError("robot", options.robot, ROBOTS)
    rig = Rig.model_validate({"robot": options.robot or "husky"}) if options.robot or like is None else like.rig
    check_cost(rig.robot, options.speed, options.headings, options.resolution)
    check_cost_output(stem, options.out, to=options.to, overwrite=options.overwrite)
    asked = {key: getattr(options, key) for key in ("to", "headings", "resolution", "area", "overwrite", "workers")}
    with show_progress() as progress:
        with progress.stage("build the world"):
            world = selected_world(options, *layouts)
        out = write_cost_map(world, options.out, rig=rig, speeds=options.speed, **asked, progress=progress)
    print_output(out)


def _selected(options: argparse.Namespace) -> "tuple[Experiment | None, tuple[Mapping[str, Any], ...], str]":
    """Return the experiment that is named, None for an environment, the layouts for ``chosen``, and the output's stem.

    Environment and seed of the options become those of the world.
    """
    like = _experiment_named(options.environment)
    layouts: tuple[Mapping[str, Any], ...] = ()
    if like is not None:
        options.environment, layouts = like.environment, ({}, like.layout)
    if options.seed is None:
        options.seed = 0 if like is None else like.seed
    return like, layouts, f"{chosen(options, *layouts).world_name}_{options.seed}"


def _experiment_named(name: str) -> "Experiment | None":
    """Load an experiment by its name or file; None for an environment or a site's file."""
    from fieldtruth.core.yaml_io import parse_mapping, read_text
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.experiment.names import EXPERIMENTS
    from fieldtruth.world.environments import ENVIRONMENTS

    is_file = is_environment_file(name)
    if name in ENVIRONMENTS or (is_file and "environment" not in parse_mapping(read_text(Path(name)), name)):
        return None
    if not is_file and name not in EXPERIMENTS:
        raise UnknownNameError("environment or experiment", name, [*ENVIRONMENTS, *EXPERIMENTS])
    return load_experiment(name)


def _gazebo(options: argparse.Namespace) -> None:
    chosen(options)
    from fieldtruth.gazebo import DEFAULT_LAYOUT, check_gazebo_output, write_gazebo

    check_gazebo_output(options.out, flavour=options.flavour, overwrite=options.overwrite)
    like = None if options.experiment is None else _experiment_for(options)
    if options.seed is None:
        options.seed = 0 if like is None else like.seed
    with show_progress() as progress:
        with progress.stage("build the world"):
            world = selected_world(options, DEFAULT_LAYOUT, {} if like is None else like.layout)
        experiments = None
        if is_environment_file(options.environment):
            with progress.stage("plan the route"):
                experiments = [_planned(world, like or _first_in(options.environment))]
        with progress.stage("write the package"):
            out = write_gazebo(
                world,
                options.out,
                flavour=options.flavour,
                rig=None if like is None else like.rig,
                beyond=not options.no_beyond,
                overwrite=options.overwrite,
                experiments=experiments,
            )
    print_output(out)


def _first_in(environment: str) -> "Experiment":
    from fieldtruth.drive.plan import experiments_in

    return experiments_in(environment)[0]


def _planned(world: "World", experiment: "Experiment") -> "Experiment":
    from fieldtruth.drive.plan import plan_route

    return experiment.model_copy(update={"route": plan_route(world, experiment)})


def _experiment_for(options: argparse.Namespace) -> "Experiment":
    """Load the experiment of a package for Gazebo: of its environment, with sensors that it can hold."""
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.gazebo import FLAVOURS
    from fieldtruth.gazebo.robot import check_rig
    from fieldtruth.world.build import check_layout

    like = load_experiment(options.experiment)
    if like.world_name != world_name(options.environment):
        expected = f"{like.world_name!r}, the environment of {options.experiment}"
        raise UsageError(f"ENVIRONMENT must be {expected}, got {options.environment!r}")
    check_layout(like.environment, like.layout, options.experiment)
    check_rig(like.rig, FLAVOURS[options.flavour])
    return like


def _rig(options: argparse.Namespace) -> None:
    if options.to is not None and options.preview:
        raise UsageError("give either --to or --preview")
    if options.preview:
        _draw(options)
        return
    from fieldtruth.core.files import output_errors, write_atomically
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.report.rig import FORMATS, sensor_table

    if options.to not in (None, *FORMATS):
        raise UnknownNameError("format", options.to, FORMATS)
    chosen, out = FORMATS[options.to or "tree"], options.out
    if out is not None:
        out = output_path(out, endings=chosen.endings, parents=False, overwrite=options.overwrite)
    rig = load_experiment(options.experiment).rig
    text = chosen.text(rig) + ("" if options.to else f"\n{sensor_table(rig)}")
    if out is None:
        print(text, end="")
        return
    with output_errors(out):
        write_atomically(out, text)
    print_line(f"{out}: {len(text.splitlines())} lines")


def _draw(options: argparse.Namespace) -> None:
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.report.drawing.images import IMAGE_ENDINGS, write_image

    experiment = load_experiment(options.experiment)
    path = f"{experiment.name}_rig.png" if options.out is None else options.out
    path = output_path(path, endings=IMAGE_ENDINGS, parents=False, overwrite=options.overwrite)
    # After the checks: the drawing library takes a second to load.
    from fieldtruth.report.rig.picture import draw_rig

    picture = draw_rig(experiment.rig, experiment.name)
    write_image(path, picture, overwrite=options.overwrite)
    print_output(path, f"{picture.shape[1]} x {picture.shape[0]} pixels")


def _cache(options: argparse.Namespace) -> None:
    from fieldtruth.core.cache import cache_folder
    from fieldtruth.core.cache_folder import SIZE_VARIABLE, entries, remove_entries, size_limit

    folder, limit = cache_folder(), size_limit()
    found = entries(folder)
    if options.clear:
        print_line(f"{folder}: {remove_entries(found) / 1e6:.0f} MB removed")
        return
    for entry in found:
        used = time.strftime("%Y-%m-%d %H:%M", time.localtime(entry.used))
        print(f"{_kind(entry):<10}  {entry.size / 1e6:8.1f} MB  last used {used}  {entry.path.name}")
    size = sum(entry.size for entry in found)
    print(f"{folder}: {size / 1e9:.2f} of {limit / 1e9:g} GB; {SIZE_VARIABLE} sets the limit in GB")


def _kind(entry: "Entry") -> str:
    name = entry.path.name
    if entry.path.is_dir():
        return "kernels"
    if name.endswith(".part"):
        return "unfinished"
    return next((kind for kind in ("light", "passage") if name.startswith(f"{kind}-")), "world")


COMMANDS: Final = {
    "world": _world,
    "scene": _scene,
    "map": _map,
    "cost": _cost,
    "gazebo": _gazebo,
    "rig": _rig,
    "cache": _cache,
}
"""Sub-commands by name."""
