# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Own objects in worlds: places, rules, what rays and wheels meet, and packages for Gazebo."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drive_worlds import make_experiment
from object_files import HEIGHT, RADIUS, SIDES, bales, barrel, entry, gate, plain, trimesh
from pydantic import ValidationError

from fieldtruth.core import transforms
from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.core.errors import ConfigurationError, DriveError, RouteError
from fieldtruth.core.geodesy import PAPER_ORIGIN, Origin
from fieldtruth.drive.ground import bearing_field
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.traversability import obstacle_outlines
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.gazebo.worlds import Part, world_bodies
from fieldtruth.interchange import write_scene
from fieldtruth.interchange.surfaces import Surface
from fieldtruth.pipeline import generate
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.camera.sensor import camera_matrix
from fieldtruth.sensors.lidar.sensing import reflectance_of
from fieldtruth.simulation.motion import _depth
from fieldtruth.validation.runner import validate
from fieldtruth.world.build import build_world, check_layout, layout_model, load_world, read_world, save_world
from fieldtruth.world.classes import class_table
from fieldtruth.world.grids import Line, Trail
from fieldtruth.world.model import Instance, Material, World, make_mesh
from fieldtruth.world.objects.config import ObjectConfig
from fieldtruth.world.objects.files import read_file
from fieldtruth.world.objects.make import make_object
from fieldtruth.world.placement import CrowdedWorldError, SwarmSpec


def own(world: World, kind: str) -> list[Instance]:
    return [each for each in world.instances if each.kind == f"own_{kind}"]


def positions(world: World, kind: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array([each.world_from_object[:3, 3] for each in own(world, kind)])


def scattered(path: Path, **rule: Any) -> ObjectConfig:
    return ObjectConfig.model_validate({"file": str(path), "label": "trash bin", "scatter": rule})


def test_layouts_that_share_an_object_have_their_own_classes(tmp_path: Path) -> None:
    bale = entry(bales(tmp_path / "bales.stl"), label="hay_bale")
    park: Any = layout_model("park")
    one, other = (
        park.model_validate({"objects": (bale,), "classes": {name: {} for name in names}})
        for names in (("hay_bale",), ("bale_net", "hay_bale"))
    )
    for label, layout in ((32, one), (33, other)):
        [material] = make_object(layout.objects[0], "", class_table(layout.classes)).materials.values()
        assert material.label == label


def test_names_of_ours_have_no_meaning(tmp_path: Path) -> None:
    """Environments look for snags, bushes and trees by kind, such as for the leaves below them."""
    for name in ("snag", "bush", "spruce", "bales"):
        [instance] = plain([entry(bales(tmp_path / "bales.stl"), name=name)]).instances
        assert (instance.name, instance.kind) == (f"{name}_1", f"own_{name}")


# ---------------------------------------------------------------------------------------------------------------------
# Places and rules


def test_objects_stand_where_they_are_placed_and_have_names_and_ids(tmp_path: Path) -> None:
    poses = [[3, 2], [-5, 1, 90], [3, 2, 0, HEIGHT]]
    world = plain(
        [entry(barrel(tmp_path / "barrel.glb"), pose=poses), entry(bales(tmp_path / "bales.stl"), pose=[8, 0])]
    )
    assert world.object_names == ("husky", "plain_ground", "barrel_1", "barrel_2", "barrel_3", "bales_1")
    assert [each.object_id for each in world.instances] == [2, 3, 4, 5]
    np.testing.assert_allclose(positions(world, "barrel"), [(3, 2, 0), (-5, 1, 0), (3, 2, HEIGHT)], atol=1e-6)
    turned = own(world, "barrel")[1].world_from_object
    np.testing.assert_allclose(turned, transforms.pose((-5, 1, 0), (0, 0, 90)), atol=1e-9)


@pytest.mark.parametrize("origin", [PAPER_ORIGIN, Origin(-33.9, 151.2, 40.0), Origin(45.5, -122.6, 200.0)])
def test_places_in_degrees(tmp_path: Path, origin: Origin) -> None:
    """North and west of the origin, also in the south and west of Greenwich."""
    pyproj = pytest.importorskip("pyproj")
    degrees = [origin.latitude + 5e-5, origin.longitude - 3e-5]
    world = plain([entry(barrel(tmp_path / "barrel.glb"), pose=(), degrees=[*degrees, 30.0])], origin=origin)
    place = f"+lat_0={origin.latitude} +lon_0={origin.longitude} +h_0={origin.height}"
    pipeline = f"+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 {place}"
    point = (*np.radians(degrees[::-1]), origin.height)
    east, north, _ = pyproj.Transformer.from_pipeline(pipeline).transform(*point, radians=True)
    np.testing.assert_allclose(positions(world, "barrel")[0, :2], (north, -east), atol=1e-3)


def test_no_corner_floats_on_a_slope(tmp_path: Path) -> None:
    """The lowest corner of the wall's base, 1.8 m down the slope of 0.2, is on the ground."""
    world = plain([entry(bales(tmp_path / "bales.stl"), pose=[10, 0])], slope=0.2)
    assert positions(world, "bales")[0, 2] == pytest.approx(0.2 * (10 - 1.8), abs=1e-5)


def test_a_place_outside_the_world_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"objects\[0\] \(barrel\): must stand in the world of 40 m x 20 m"):
        plain([entry(barrel(tmp_path / "barrel.glb"), pose=[20.5, 0])])


def test_scattered_objects_keep_apart_and_off_trails_corridors_and_slopes(tmp_path: Path) -> None:
    path = barrel(tmp_path / "barrel.glb")
    trail = Trail(Line.through([(-30, 0), (30, 0)]), 3.0)
    corridor = Line.through([(-18, 6), (18, 6)], smooth=False)
    rule = {"count": 25, "spacing": 1.5, "slope": 10, "scales": [0.5, 1.0]}
    world = plain([scattered(path, **rule)], slope=0.3, trails=[trail], corridors=[corridor])
    x, y, z = positions(world, "barrel").T
    assert len(x) == 25
    assert (x < 0.25).all()  # beyond, the ground rises by 17 deg
    assert (np.abs(y) > 1.5).all()
    assert (np.abs(y - 6) > 1.0).all()
    away = np.hypot(x[:, None] - x, y[:, None] - y) + 1e3 * np.eye(25)
    assert away.min() >= 1.5
    np.testing.assert_allclose(z, 0, atol=1e-6)
    scale = np.array([each.world_from_object[2, 2] for each in own(world, "barrel")])
    assert 0.5 <= scale.min() < scale.max() <= 1.0


def test_more_of_one_kind_does_not_move_another(tmp_path: Path) -> None:
    path = barrel(tmp_path / "barrel.glb")
    drums = scattered(path, per_hectare=100).model_copy(update={"name": "drum"})
    alone, both = plain([drums]), plain([drums, scattered(path, count=5)])
    assert len(own(alone, "drum")) == 8  # 100 to the hectare on 800 m2
    np.testing.assert_array_equal(positions(alone, "drum"), positions(both, "drum"))


def test_on_the_trail_alone(tmp_path: Path) -> None:
    trail = Trail(Line.through([(-30, 0), (30, 0)]), 3.0)
    world = plain([scattered(barrel(tmp_path / "barrel.glb"), count=6, surface=["trail"])], trails=[trail])
    assert (np.abs(positions(world, "barrel")[:, 1]) < 1.5).all()
    with pytest.raises(ConfigurationError, match="unknown surface 'trial'; did you mean 'trail'"):
        plain([scattered(barrel(tmp_path / "barrel.glb"), count=6, surface=["trial"])])


def test_clusters(tmp_path: Path) -> None:
    rule = {"count": 12, "cluster": 6, "cluster_radius": 0.8}
    x, y, _ = positions(plain([scattered(barrel(tmp_path / "barrel.glb"), **rule)], seed=2), "barrel").T
    away = np.hypot(x[:, None] - x, y[:, None] - y)
    assert ((away < 4.0).sum(axis=1) >= 4).all()  # of a uniform scatter 12 pi 4^2 / 800 = 0.8 are so near


def test_too_many_are_counted(tmp_path: Path) -> None:
    with pytest.raises(CrowdedWorldError, match=r"\(barrel\): only \d+ of 60 fit; ask for fewer, or less spacing"):
        plain([scattered(barrel(tmp_path / "barrel.glb"), count=60, spacing=8.0)])


def test_nothing_grows_where_a_scattered_object_stands(tmp_path: Path) -> None:
    blade = make_mesh("blade", np.eye(3), np.eye(3), np.zeros((3, 2)), [[0, 1, 2]], ("blade_green",))
    grass = SwarmSpec(name="grass", kind="grass", meshes=[blade], per_m2=4.0)
    world = plain([scattered(barrel(tmp_path / "barrel.glb"), count=10)], swarm=grass)
    at = world.swarms[0].world_from_object[:, :2, 3]
    away = np.linalg.norm(at[:, None] - positions(world, "barrel")[:, :2], axis=2)
    assert away.min() > RADIUS
    assert 3100 < len(at) < 3200


def test_layouts_of_all_environments_take_objects(tmp_path: Path) -> None:
    path = str(barrel(tmp_path / "barrel.glb"))
    good = {"file": path, "label": "bench", "pose": [0, 0]}
    for name in ("park", "lake", "forest", "hillside"):
        check_layout(name, {"objects": [good]})
    with pytest.raises(ConfigurationError, match="two have the name 'barrel'; give one of them a name of its own"):
        check_layout("park", {"objects": [good, good]})
    with pytest.raises(
        ConfigurationError, match=r"layout: objects\[0\].collider must be convex_hull, mesh, box or none"
    ):
        check_layout("park", {"objects": [good | {"collider": "sphere"}]})
    with pytest.raises(ConfigurationError, match=r"objects\[0\].file: no such file"):
        check_layout("park", {"objects": [good | {"file": str(tmp_path / "other.glb")}]})
    with pytest.raises(ValidationError):
        ObjectConfig.model_validate(good | {"scale": 0})


@pytest.mark.slow
@pytest.mark.parametrize(("name", "size"), [("forest", [24, 16]), ("hillside", [24, 16]), ("thicket", [24, 16])])
def test_environments_stand_and_scatter_objects(tmp_path: Path, name: str, size: list[int]) -> None:
    """Those with a place have the first ids; nothing that is placed later overlaps one."""
    stand = {"file": str(bales(tmp_path / "bales.stl")), "label": "fence", "pose": [4, 3, 20]}
    scatter = {"file": str(barrel(tmp_path / "barrel.glb")), "label": "trash bin", "scatter": {"count": 5}}
    world = build_world(name, 0, {"size": size, "grid": 0.1, "objects": [stand, scatter]})
    assert world.object_names[2] == "bales_1"
    assert [each.name for each in own(world, "barrel")] == [f"barrel_{k}" for k in range(1, 6)]
    assert {"bales_plain_0", "barrel_blue_paint_0"} <= set(world.materials)
    taken = [(*each.world_from_object[:2, 3], world.meshes[each.mesh]) for each in world.instances]
    for x, y, mesh in taken:
        if mesh.name != "own_bales" and mesh.colliders:
            assert np.hypot(x - 4, y - 3) > 0.25  # half the wall's thickness


def test_a_stored_world_keeps_its_objects(tmp_path: Path) -> None:
    config = entry(gate(tmp_path / "gate.stl"), collider="mesh", reflectance=0.25)
    world = replace(plain([config]), layout={"objects": [config.model_dump(mode="json")]})
    save_world(tmp_path / "world.npz", world)
    again = read_world(tmp_path / "world.npz")
    assert again.layout == world.layout
    assert again.materials == world.materials
    assert again.meshes["own_gate"].colliders == world.meshes["own_gate"].colliders


# ---------------------------------------------------------------------------------------------------------------------
# Rays


def traced(world: World, tmp_path: Path) -> tuple[Any, np.ndarray[tuple[int, ...], np.dtype[np.int64]]]:
    """The files' meshes at their poses, as trimesh reads and moves them, and the instance id of each triangle."""
    files = {"barrel": (tmp_path / "barrel.glb", trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))}
    files["bales"] = (tmp_path / "bales.stl", np.eye(4))
    parts, ids = [], []
    for instance in world.instances:
        path, upright = files[instance.kind.removeprefix("own_")]
        mesh = trimesh.load(path, force="mesh")
        mesh.apply_transform(upright)
        if instance.kind == "own_barrel":  # our x is glTF's z, which that rotation takes to -y
            mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 0, 1)))
        low, high = mesh.bounds
        mesh.apply_translation((-(low + high)[0] / 2, -(low + high)[1] / 2, -low[2]))
        mesh.apply_transform(instance.world_from_object)
        parts.append(mesh)
        ids += [instance.object_id] * len(mesh.faces)
    return trimesh.util.concatenate(parts), np.array(ids)


@pytest.fixture
def yard(tmp_path: Path) -> World:
    barrels = entry(barrel(tmp_path / "barrel.glb"), pose=[[4, 1.5, 20], [5, -1], [4.5, 0.2, 0, HEIGHT]])
    return plain([barrels, entry(bales(tmp_path / "bales.stl"), label="bench", pose=[8, 0, 70])])


def test_ranges_and_classes_are_those_of_trimesh(yard: World, tmp_path: Path) -> None:
    mesh, ids = traced(yard, tmp_path)
    turn, tilt = np.meshgrid(np.radians(np.linspace(-40, 40, 161)), np.radians(np.linspace(-1, 15, 12)))
    ahead = np.stack([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)], axis=-1).reshape(-1, 3)
    origin = np.array([0.013, 0.027, 0.5])
    hits = Scene(yard).cast(origin, ahead)
    caster = trimesh.ray.ray_triangle.RayMeshIntersector(mesh)
    at, ray, face = caster.intersects_location(np.tile(origin, (len(ahead), 1)), ahead, multiple_hits=False)
    distance = np.full(len(ahead), np.inf)
    distance[ray] = np.linalg.norm(at - origin, axis=1)
    below = np.where(ahead[:, 2] < 0, -0.5 / np.minimum(ahead[:, 2], -1e-9), np.inf)
    own_first = distance < below
    assert 300 < own_first.sum() < 1500
    expected = np.zeros(len(ahead), np.int64)
    expected[ray] = ids[face]
    np.testing.assert_array_equal(hits.instance[own_first], expected[own_first])
    np.testing.assert_allclose(hits.range_m[own_first], distance[own_first], atol=2e-4)
    assert set(hits.label[own_first & (expected == 5)].tolist()) == {int(Label.BENCH)}
    assert (hits.instance[~own_first] <= 1).all()


def test_masks_are_those_of_trimesh(yard: World, tmp_path: Path) -> None:
    mesh, ids = traced(yard, tmp_path)
    config = CameraConfig(width=96, height=64)
    camera = LabelCamera(config, Scene(yard))
    world_from_optical = transforms.pose((0.013, 0.027, 0.7)) @ OPTICAL
    images = camera.label(world_from_optical)
    k = camera_matrix(config)
    v, u = np.mgrid[:64, :96]
    rays = np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones((64, 96))], axis=-1).reshape(-1, 3)
    ahead = rays @ world_from_optical[:3, :3].T
    origins = np.tile(world_from_optical[:3, 3], (len(ahead), 1))
    caster = trimesh.ray.ray_triangle.RayMeshIntersector(mesh)
    _, ray, face = caster.intersects_location(origins, ahead, multiple_hits=False)
    expected = np.ones(len(ahead), np.int64)
    expected[ray] = ids[face]
    mask = expected.reshape(64, 96)
    above = images.instance > 1
    np.testing.assert_array_equal(images.instance[above], mask[above])
    assert (above == (mask > 1)).mean() > 0.999  # the crumbs of the soil hide a pixel row of the lowest centimetres
    assert above.sum() > 500


# ---------------------------------------------------------------------------------------------------------------------
# Colliders


def test_the_planner_knows_the_hull(tmp_path: Path) -> None:
    [outline] = obstacle_outlines(plain([entry(bales(tmp_path / "bales.stl"), pose=[5, 1, 90])]))
    assert outline.name == "bales_1"
    np.testing.assert_allclose(np.ptp(outline.corners, axis=0), (0.5, 3.6), atol=1e-5)
    np.testing.assert_allclose(outline.corners.min(axis=0), (4.75, 1 - 1.8), atol=1e-5)


def test_a_route_through_a_wall_is_refused_and_the_robot_touches_it(tmp_path: Path) -> None:
    world = plain([entry(bales(tmp_path / "bales.stl"), pose=[5, 0, 90])])
    experiment = make_experiment([(9.0, 0.0)])
    with pytest.raises(RouteError, match="bales_1"):
        plan_route(world, experiment)
    with pytest.raises(DriveError, match="robot touched bales_1") as error:
        drive(world, experiment)
    x = float(str(error.value).partition("x, y = ")[2].partition(",")[0])
    assert x == pytest.approx(5.0 - 0.25 - 0.495, abs=0.02)  # half the wall, half the robot


def test_a_robot_passes_a_gate_that_is_a_mesh_but_not_its_hull(tmp_path: Path) -> None:
    path = gate(tmp_path / "gate.stl")
    experiment = make_experiment([(7.0, 0.0)])
    drive(plain([entry(path, pose=[3, 0], collider="mesh")]), experiment)
    assert plan_route(plain([entry(path, pose=[3, 0], collider="mesh")]), experiment) == experiment.route
    for collider in ("convex_hull", "box"):
        with pytest.raises(RouteError, match="gate_1"):
            plan_route(plain([entry(path, pose=[3, 0], collider=collider)]), experiment)
    beside = plain([entry(path, pose=[3, 1.5], collider="mesh")])  # a post in the way
    with pytest.raises(DriveError, match="robot touched gate_1"):
        drive(beside, experiment)
    for label in ("trash bin", "trunk", "rock"):  # roots of trunks and stones would bear wheels
        passable = plain([entry(path, pose=[3, 1.5], collider="none", label=label)])
        assert plan_route(passable, experiment) == experiment.route
        assert bearing_field(passable).heights.max() == 0.0


def test_every_class_of_an_object_has_a_reflectance() -> None:
    table = {
        label: reflectance_of(Material(name="m", label=label, texture="t")) for label in CLASSES.of_objects.values()
    }
    assert all(0 < found.value < 1 for found in table.values())
    assert table[Label.WATER].value < 0.05 < table[Label.BUILDING].value
    own = Material(name="m", label=32, texture="t")
    assert reflectance_of(own).value == 0.3
    assert reflectance_of(replace(own, reflectance=0.8)).value == 0.8


def test_depth_in_a_hull(tmp_path: Path) -> None:
    [hull] = plain([entry(bales(tmp_path / "bales.stl"))]).meshes["own_bales"].colliders
    points = np.array([[0.0, 0.0, 0.5], [1.7, 0.0, 0.5], [2.0, 0.0, 0.5], [0.0, 0.0, 1.05]])
    np.testing.assert_allclose(_depth(hull, points), (0.25, 0.1, -0.2, -0.05), atol=1e-6)


def test_bodies_for_gazebo(tmp_path: Path) -> None:
    """The file's triangles, its class, and nothing solid without a collider."""
    surfaces: dict[str, Surface] = {}

    def add(part: Part, surface: Surface) -> None:
        surfaces[part.model] = surface

    hull, none = (
        entry(bales(tmp_path / "bales.stl"), pose=[5, 0]),
        entry(barrel(tmp_path / "barrel.glb"), collider="none"),
    )
    box = entry(gate(tmp_path / "gate.stl"), pose=[-5, 0], collider="box", scale=0.5)
    bodies = {body.name: body for body in world_bodies(plain([hull, none, box]), add, beyond=False)}
    assert {name for name in bodies if name != "plain_ground"} == {"bales_1", "barrel_1", "gate_1"}
    assert [part.solid for part in bodies["bales_1"].parts] == [True]
    assert [part.solid for part in bodies["barrel_1"].parts] == [False]
    assert [(part.label, part.returns) for part in bodies["barrel_1"].parts] == [(Label.TRASH_BIN, True)]
    assert bodies["bales_1"].colliders == ()  # its solid part is what wheels touch
    assert bodies["gate_1"].colliders[0].size == pytest.approx((0.1, 1.6, 1.1))
    triangles = trimesh.load(tmp_path / "bales.stl").triangles
    assert len(surfaces["own_bales"].faces) == len(triangles)
    np.testing.assert_allclose(
        np.ptp(surfaces["own_bales"].vertices, axis=0), np.ptp(triangles.reshape(-1, 3), axis=0), atol=1e-5
    )


@pytest.mark.slow
def test_usd_and_gltf_scenes_of_a_world_are_read_back(tmp_path: Path) -> None:
    """Positions, number of triangles and colours of a barrel, after both of our writers and both of our readers."""
    pytest.importorskip("pxr")
    world = plain([entry(barrel(tmp_path / "barrel.glb"), pose=[[4, 2, 30]])])
    for form, name in (("usd", "scene_usd"), ("gltf", "scene.glb")):
        write_scene(world, tmp_path / name, to=form)
        [path] = [tmp_path / name] if form == "gltf" else (tmp_path / name).glob("*.usd*")
        parts = [part for part in read_file(path).parts if part.look.name == "barrel_blue_paint_0"]
        [part] = parts
        assert len(part.faces) == 4 * SIDES
        used = part.vertices[np.unique(part.faces)]
        middle = (4, 2, HEIGHT / 2) if form == "usd" else (4, HEIGHT / 2, -2)  # y up in glTF
        np.testing.assert_allclose((used.min(axis=0) + used.max(axis=0)) / 2, middle, atol=1e-3)
        assert part.look.image is not None
        np.testing.assert_allclose(
            part.look.image.reshape(-1, 3).mean(axis=0), (53.75, 97.5, 167.5), atol=5
        )  # of a JPEG


def test_a_changed_texture_makes_another_world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stored world is taken only if all files that its objects name have the same bytes."""
    barrel(tmp_path / "barrel.obj")
    [image] = tmp_path.glob("*.png")
    built = list[int]()

    def build(*_: object, **__: object) -> World:
        built.append(1)
        return plain([])

    monkeypatch.setattr("fieldtruth.world.build.build_world", build)
    layout = {"objects": [{"file": str(tmp_path / "barrel.obj"), "label": "bench", "pose": [0, 0]}]}
    for _ in range(2):
        load_world("park", 0, layout, cache_folder=tmp_path / "cache")
    assert len(built) == 1
    image.write_bytes(image.read_bytes() + b"\0")
    load_world("park", 0, layout, cache_folder=tmp_path / "cache")
    assert len(built) == 2


SITE = """
centre: [-33.9, 151.2]
size: [24, 16]
grid: 0.1
individuals: 1
grass_per_m2: 0.5
objects:
  - {file: barrel.glb, label: trash_bin, degrees: [[-33.90001, 151.20003], [-33.89999, 151.20003, 30]]}
  - {file: bales.stl, label: fence, pose: [7, 4], collider: mesh}
  - {file: barrel.glb, name: log_cabin, label: building, scatter: {count: 4}}
"""
RUN = """
name: yard
environment: yard.yaml
route: {metres: {start: [-6, 0], waypoints: [[6, 0]]}}
rig: {lidar: {columns: 128, rings: 16}, cameras: {width: 64, height: 48}}
seconds: 1
"""


@pytest.mark.slow
def test_a_run_in_a_site_with_own_objects_is_valid(tmp_path: Path) -> None:
    """The files lie beside the site's; every point and pixel is traced again, and each object has its class only."""
    barrel(tmp_path / "barrel.glb")
    bales(tmp_path / "bales.stl")
    (tmp_path / "yard.yaml").write_text(SITE)
    (tmp_path / "run.yaml").write_text(RUN)
    experiment = load_experiment(tmp_path / "run.yaml")
    generate(experiment, tmp_path / "out")
    checks = {check.name: check.passed for check in validate(tmp_path / "out" / "yard")}
    assert False not in checks.values()
    assert not [check for check in validate(tmp_path / "out" / "yard", quick=True) if check.passed is False]
    assert all(checks[name] for name in ("retraced clouds", "retraced images", "independent rays", "object classes"))
    names = load_world(experiment.environment, 0, experiment.layout).object_names
    assert names[2:5] == ("barrel_1", "barrel_2", "bales_1")
    assert {"log_cabin_1", "log_cabin_4"} <= set(names)
