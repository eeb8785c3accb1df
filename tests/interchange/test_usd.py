# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""USD stages, read back with Pixar's library: every object, its pose, class, material and number of triangles."""

import errno
import resource
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from interchange_worlds import small_world
from sense_worlds import box, make_world

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.gazebo import DEFAULT_LAYOUT
from fieldtruth.interchange.ground import ground_tiles
from fieldtruth.world.build import load_world
from fieldtruth.world.model import World

pytest.importorskip("pxr", reason="usd-core is not installed")

from pxr import Gf, Usd, UsdGeom, UsdSemantics, UsdShade

from fieldtruth.interchange import usd

pytestmark = pytest.mark.usefixtures("small_ground_images")


def turned_world() -> World:
    """The small world; members of its swarm are turned about all axes, and their second mesh has a species."""
    world = small_world()
    (swarm,) = world.swarms
    rng = np.random.default_rng(7)
    poses = swarm.world_from_object.copy()
    for pose, scale, rpy in zip(poses, rng.uniform(0.5, 2, 40), rng.uniform(-179, 179, (40, 3)), strict=True):
        pose[:3, :3] = scale * transforms.pose((0, 0, 0), rpy)[:3, :3]
    meshes = {**world.meshes, "tuft_1": replace(world.meshes["tuft_1"], species=("reed", "sedge"))}
    return replace(world, meshes=meshes, swarms=(replace(swarm, world_from_object=poses),))


@pytest.fixture(scope="module")
def world() -> World:
    return turned_world()


@pytest.fixture(scope="module")
def stage(world: World, tmp_path_factory: pytest.TempPathFactory) -> Usd.Stage:
    folder = tmp_path_factory.mktemp("usd") / "out"
    usd.write(world, folder, beyond=True)
    return Usd.Stage.Open(str(folder / "world.usdc"))


def drawn(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Prims that a renderer visits, with those below instances, without those below point instancers."""
    prims = iter(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
    for prim in prims:
        yield prim
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()


def meshes_below(prim: Usd.Prim) -> list[UsdGeom.Mesh]:
    below = Usd.PrimRange(prim, Usd.TraverseInstanceProxies())
    return [UsdGeom.Mesh(p) for p in below if p.IsA(UsdGeom.Mesh)]


def triangles(mesh: UsdGeom.Mesh) -> int:
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get())
    assert (counts == 3).all()
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
    return len(counts)


def label_of(mesh: UsdGeom.Mesh) -> int:
    """Class id; the semantic label has the name of the same class."""
    prim = mesh.GetPrim()
    number = int(prim.GetAttribute("fieldtruth:classId").Get())
    assert list(UsdSemantics.LabelsAPI(prim, "class").GetLabelsAttr().Get()) == [CLASSES[number].name]
    return number


def triangles_by_id_and_class(stage: Usd.Stage) -> Counter[tuple[int, int]]:
    """Triangles that a renderer draws, by instance id, which the nearest ancestor with an id states, and by class."""
    found: Counter[tuple[int, int]] = Counter()
    for prim in drawn(stage):
        if prim.IsA(UsdGeom.Mesh):
            found[instance_id(prim), label_of(UsdGeom.Mesh(prim))] += triangles(UsdGeom.Mesh(prim))
        if prim.IsA(UsdGeom.PointInstancer):
            instancer = UsdGeom.PointInstancer(prim)
            rows = np.bincount(np.array(instancer.GetProtoIndicesAttr().Get()))
            for path, count in zip(instancer.GetPrototypesRel().GetTargets(), rows.tolist(), strict=False):
                for mesh in meshes_below(stage.GetPrimAtPath(path)):
                    found[instance_id(prim), label_of(mesh)] += count * triangles(mesh)
    return found


def instance_id(prim: Usd.Prim) -> int:
    while not prim.HasAttribute("fieldtruth:instanceId"):
        prim = prim.GetParent()
    return int(prim.GetAttribute("fieldtruth:instanceId").Get())


def expected_triangles(world: World, *, beyond: bool) -> Counter[tuple[int, int]]:
    found: Counter[tuple[int, int]] = Counter()

    def add(number: int, mesh: Any, count: int = 1) -> None:
        labels = np.array([world.materials[name].label for name in mesh.materials])[mesh.material]
        for label, faces in enumerate(np.bincount(labels, minlength=16).tolist()):
            if faces:
                found[number, label] += count * faces

    for instance in world.instances:
        add(instance.object_id, world.meshes[instance.mesh])
    for swarm in world.swarms:
        inside = (np.abs(swarm.world_from_object[:, :2, 3]) <= np.array(world.size) / 2).all(axis=1)
        for row in swarm.mesh[inside | beyond]:
            add(swarm.object_id, world.meshes[swarm.meshes[row]])
    for tile in ground_tiles(world):
        for surface in tile.surfaces:
            found[1, int(surface.label)] += len(surface.faces)
    if beyond and world.backdrop is not None:
        add(1, world.backdrop)
    return found


def matrix(found: Gf.Matrix4d) -> Array:
    """A matrix for column vectors."""
    return np.array(found, np.float64).T


def test_stage_is_in_metres_with_z_up(stage: Usd.Stage) -> None:
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert stage.GetRootLayer().customLayerData["fieldtruth"]["environment"] == "tiny"


def test_objects_have_the_poses_ids_and_kinds_of_the_world(stage: Usd.Stage, world: World) -> None:
    prims = stage.GetPrimAtPath("/World/Objects").GetChildren()
    assert [prim.GetName() for prim in prims] == [i.name for i in world.instances]
    for prim, instance in zip(prims, world.instances, strict=True):
        pose = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
        np.testing.assert_allclose(matrix(pose), instance.world_from_object, atol=1e-12)
        assert prim.IsInstance()
        assert instance_id(prim) == instance.object_id
        assert list(UsdSemantics.LabelsAPI(prim, "kind").GetLabelsAttr().Get()) == [instance.kind]
        tint = UsdGeom.PrimvarsAPI(prim).GetPrimvar("tint").Get()
        np.testing.assert_allclose(tint, [instance.tint], rtol=1e-6)
    assert prims[0].GetPrototype() == prims[1].GetPrototype()  # the trees share a mesh
    assert prims[0].GetPrototype() != prims[2].GetPrototype()


def test_swarm_members_have_the_poses_of_the_world(stage: Usd.Stage, world: World) -> None:
    (swarm,) = world.swarms
    now = Usd.TimeCode.Default()
    for name, rows in (("tufts", np.arange(30)), ("tufts_beyond", np.arange(30, 40))):
        instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath(f"/World/Swarms/{name}"))
        found = instancer.ComputeInstanceTransformsAtTime(now, now, UsdGeom.PointInstancer.ExcludeProtoXform)
        poses = np.array([matrix(pose) for pose in found])
        np.testing.assert_allclose(poses, swarm.world_from_object[rows], atol=1e-5)
        targets = instancer.GetPrototypesRel().GetTargets()
        meshes = [targets[row].name for row in instancer.GetProtoIndicesAttr().Get()]
        assert meshes == [swarm.meshes[row] for row in swarm.mesh[rows]]
        assert instance_id(instancer.GetPrim()) == 6
        tint = UsdGeom.PrimvarsAPI(instancer).GetPrimvar("tint")
        assert tint.GetInterpolation() == "vertex"
        np.testing.assert_array_equal(tint.Get(), swarm.tint[rows])
        # The orientations in half precision are those in single precision.
        halves = [quaternion(q) for q in instancer.GetOrientationsAttr().Get()]
        singles = [quaternion(q) for q in instancer.GetOrientationsfAttr().Get()]
        np.testing.assert_allclose(halves, singles, atol=1e-3)
    reeds = stage.GetPrimAtPath("/World/Swarms/tufts/Prototypes/tuft_1")
    assert list(UsdSemantics.LabelsAPI(reeds, "species").GetLabelsAttr().Get()) == ["reed", "sedge"]


def quaternion(found: Any) -> list[float]:
    return [found.GetReal(), *found.GetImaginary()]


@pytest.mark.parametrize("beyond", [False, True])
def test_triangles_of_each_instance_and_class_are_those_of_the_world(
    world: World, tmp_path: Path, beyond: bool
) -> None:
    usd.write(world, tmp_path / "out", beyond=beyond)
    stage = Usd.Stage.Open(str(tmp_path / "out" / "world.usdc"))
    found = triangles_by_id_and_class(stage)
    assert found == expected_triangles(world, beyond=beyond)
    assert found[1, Label.TRAIL] > 0
    assert {number for number, _ in found} == {1, 2, 3, 4, 5, 6}


def test_points_normals_and_texture_coordinates_are_those_of_the_mesh(stage: Usd.Stage, world: World) -> None:
    expected, (mesh,) = world.meshes["bench"], meshes_below(stage.GetPrimAtPath("/World/Objects/bench_1"))
    faces = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    for found, of_mesh in (
        (mesh.GetPointsAttr().Get(), expected.vertices),
        (mesh.GetNormalsAttr().Get(), expected.normals),
        (UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get(), expected.uv),
    ):
        np.testing.assert_array_equal(np.array(found)[faces], of_mesh[expected.faces])
    assert mesh.GetNormalsInterpolation() == "vertex"
    assert mesh.GetOrientationAttr().Get() == "rightHanded"
    assert mesh.GetDoubleSidedAttr().Get()


def test_every_drawn_mesh_has_a_material_with_a_texture_that_exists(stage: Usd.Stage, world: World) -> None:
    folder = Path(stage.GetRootLayer().realPath).parent
    names = set()
    for prim in drawn(stage):
        if prim.IsA(UsdGeom.Mesh):
            material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            surface, _, _ = material.ComputeSurfaceSource()
            assert surface.GetShaderId() == "UsdPreviewSurface"
            texture = UsdShade.Shader(surface.GetInput("diffuseColor").GetConnectedSource()[0])
            image = Path(texture.GetInput("file").Get().resolvedPath)
            assert image.is_file()
            assert image.parent == folder / "textures"
            names.add(material.GetPrim().GetName())
    assert {"wood", "bark", "leaf", "terrain_0_0"} <= names


def test_material_multiplies_its_colour_factor_with_the_texture(stage: Usd.Stage) -> None:
    texture = UsdShade.Shader(stage.GetPrimAtPath("/World/Materials/bark/texture"))
    np.testing.assert_allclose(texture.GetInput("scale").Get(), (1.4, 0.5, 0.5, 1.0), rtol=1e-6)
    assert texture.GetInput("sourceColorSpace").Get() == "sRGB"
    leaf, bark = (stage.GetPrimAtPath(f"/World/Materials/{name}") for name in ("leaf", "bark"))
    assert leaf.GetAttribute("fieldtruth:translucency").Get() == pytest.approx(0.4)
    assert not bark.HasAttribute("fieldtruth:translucency")


def test_validators_of_usd_find_nothing(stage: Usd.Stage) -> None:
    validation = pytest.importorskip("pxr.UsdValidation", reason="usd-core is older than its validators")
    validators = validation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 10
    found = validation.ValidationContext(validators).Validate(stage)
    assert [error.GetErrorAsString() for error in found] == []


def test_stage_can_be_referenced_by_another(stage: Usd.Stage) -> None:
    """Materials stay bound below another prim."""
    other = Usd.Stage.CreateInMemory()
    prim = other.DefinePrim("/Project/Field")
    prim.GetReferences().AddReference(stage.GetRootLayer().realPath)
    mesh = other.GetPrimAtPath("/Project/Field/Objects/tree_1/leaf")
    material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
    assert material.GetPath() == "/Project/Field/Materials/leaf"


def test_same_world_gives_the_same_bytes(world: World, tmp_path: Path) -> None:
    for name in ("first", "second"):
        usd.write(world, tmp_path / name, beyond=True)
    paths = [path for path in (tmp_path / "first").rglob("*") if path.is_file()]
    assert len(paths) > 2
    for path in paths:
        assert path.read_bytes() == (tmp_path / "second" / path.relative_to(tmp_path / "first")).read_bytes(), path.name


def test_names_that_usd_does_not_allow_are_changed(tmp_path: Path) -> None:
    seat = box("garden-seat", (1, 1, 1), "wood")
    world = make_world([(seat, np.eye(4))], side=4.0)
    (instance,) = world.instances
    usd.write(replace(world, instances=(replace(instance, name="garden-seat_1"),)), tmp_path / "out", beyond=True)
    stage = Usd.Stage.Open(str(tmp_path / "out" / "world.usdc"))
    (mesh,) = meshes_below(stage.GetPrimAtPath("/World/Objects/garden_seat_1"))
    assert triangles(mesh) == 12


def test_full_disk_is_an_error_of_the_system(world: World, tmp_path: Path) -> None:
    """As a limit of the file's size, above that of the images."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, limits[1]))
        with pytest.raises(OSError, match="File too large") as error:
            usd.write(world, tmp_path / "out", beyond=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert error.value.errno == errno.EFBIG
    assert "\n" not in str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize("environment", ["park", "lake"])
def test_environments_have_all_their_triangles(environment: str, tmp_path: Path) -> None:
    """The ground of the park as fine as it is, that of the lake with the nodes of packages for Gazebo."""
    world = load_world(environment, 0, {} if environment == "park" else DEFAULT_LAYOUT)
    usd.write(world, tmp_path / "out", beyond=True)
    stage = Usd.Stage.Open(str(tmp_path / "out" / "world.usdc"))
    assert triangles_by_id_and_class(stage) == expected_triangles(world, beyond=True)
    assert len(stage.GetPrimAtPath("/World/Objects").GetChildren()) == len(world.instances)
    test_validators_of_usd_find_nothing(stage)
