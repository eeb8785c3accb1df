# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stored worlds keep every byte; damaged or foreign files in the cache are rebuilt."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from park_worlds import digest, park_variant, real_park

from fieldtruth.core.errors import UnknownNameError
from fieldtruth.world import build
from fieldtruth.world.build import load_world, read_world, save_world
from fieldtruth.world.model import World


@pytest.fixture(scope="module")
def park() -> World:
    return real_park()


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch, park: World) -> list[tuple[str, int]]:
    """Calls of a builder that takes no time."""
    calls: list[tuple[str, int]] = []

    def quick(environment: str, seed: int = 0, _layout: object = None, **_: object) -> World:
        calls.append((environment, seed))
        return replace(small(park), seed=seed)

    monkeypatch.setattr(build, "build_world", quick)
    return calls


def small(park: World) -> World:
    """Two objects, a corner of the terrain and one texture of the park: quick to write."""
    kept, terrain = (park.instances[0], park.instances[-1]), park.terrain
    return replace(
        park,
        terrain=replace(
            terrain,
            field=replace(terrain.field, heights=terrain.field.heights[:201, :101].copy()),
            layer=None,
            trail_distance=replace(terrain.trail_distance, values=terrain.trail_distance.values[:101, :51].copy()),
            cover=replace(terrain.cover, values=terrain.cover.values[:101, :51].copy()),
        ),
        instances=kept,
        meshes={i.mesh: park.meshes[i.mesh] for i in kept},
        textures=dict(list(park.textures.items())[:1]),
    )


def test_round_trip_of_the_park_keeps_every_field_and_byte(park: World, tmp_path: Path) -> None:
    park = replace(park, textures=dict(list(park.textures.items())[:3]))  # all of them take seconds
    save_world(tmp_path / "park.npz", park)
    again = read_world(tmp_path / "park.npz")
    assert digest(again) == digest(park)
    assert again.size == park.size
    assert again.object_names == park.object_names
    assert list(again.meshes) == list(park.meshes)
    assert list(again.materials.values()) == list(park.materials.values())
    assert [i.name for i in again.instances] == [i.name for i in park.instances]
    for name, mesh in park.meshes.items():
        assert again.meshes[name].colliders == mesh.colliders
        assert again.meshes[name].vertices.dtype == mesh.vertices.dtype
    assert [p.name for p in tmp_path.iterdir()] == ["park.npz"]


def test_digest_detects_a_change_of_one_bit(park: World) -> None:
    """Checks the helper of the test above."""
    park = small(park)
    heights = park.terrain.field.heights.copy()
    heights[7, 9] = np.nextafter(heights[7, 9], np.float32(99))
    terrain = replace(park.terrain, field=replace(park.terrain.field, heights=heights))
    assert digest(replace(park, terrain=terrain)) != digest(park)
    first = replace(park.instances[0], tint=(1.0, 1.0, 0.5))
    assert digest(replace(park, instances=(first, *park.instances[1:]))) != digest(park)


def test_round_trip_without_backdrop_objects_and_textures(park: World, tmp_path: Path) -> None:
    bare = replace(park, backdrop=None, instances=(), meshes={}, textures={}, object_names=("husky", "ground"))
    save_world(tmp_path / "folder" / "bare.npz", bare)
    assert digest(read_world(tmp_path / "folder" / "bare.npz")) == digest(bare)


def test_a_layer_is_kept_and_lies_on_the_field(park: World, tmp_path: Path) -> None:
    bare = small(park)
    field = bare.terrain.field
    assert bare.terrain.surface is field
    layer = np.random.default_rng(3).uniform(0.0, 0.05, field.heights.shape).astype(np.float32)
    grown = replace(bare, terrain=replace(bare.terrain, layer=layer))
    save_world(tmp_path / "grown.npz", grown)
    terrain = read_world(tmp_path / "grown.npz").terrain
    assert terrain.layer is not None
    np.testing.assert_allclose(terrain.layer, layer, rtol=0.0, atol=2e-5)
    assert terrain.field.heights.tobytes() == field.heights.tobytes()
    x, y = field.x0 + field.spacing * 40, field.y0 + field.spacing * 21
    assert terrain.surface.height_at(x, y) == pytest.approx(field.heights[40, 21] + layer[40, 21], abs=2e-5)


def test_world_is_read_from_the_cache(builds: list[tuple[str, int]], tmp_path: Path) -> None:
    first = load_world("park", 3, cache_folder=tmp_path)
    again = load_world("park", 3, cache_folder=tmp_path)
    assert builds == [("park", 3)]
    assert digest(first) == digest(again)
    load_world("park", 4, cache_folder=tmp_path)
    assert builds == [("park", 3), ("park", 4)]


def test_two_versions_of_the_code_keep_their_worlds(
    builds: list[tuple[str, int]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for version in ("old", "new", "old", "new"):
        monkeypatch.setattr(build, "world_key", lambda environment, version=version: version)
        load_world("park", 3, cache_folder=tmp_path)
    assert builds == [("park", 3)] * 2


@pytest.mark.parametrize("keep", [0, 1, 100, 0.5, 0.999])
def test_truncated_file_is_rebuilt(builds: list[tuple[str, int]], tmp_path: Path, keep: float) -> None:
    whole = load_world("park", 0, cache_folder=tmp_path)
    (path,) = tmp_path.iterdir()
    data = path.read_bytes()
    path.write_bytes(data[: int(keep * len(data)) if isinstance(keep, float) else keep])
    assert digest(load_world("park", 0, cache_folder=tmp_path)) == digest(whole)
    assert len(builds) == 2
    assert path.read_bytes() == data
    load_world("park", 0, cache_folder=tmp_path)
    assert len(builds) == 2


@pytest.mark.parametrize("position", [0.1, 0.3, 0.6, 0.9])
def test_damaged_bytes_are_rebuilt(builds: list[tuple[str, int]], tmp_path: Path, position: float) -> None:
    whole = load_world("park", 0, cache_folder=tmp_path)
    (path,) = tmp_path.iterdir()
    data = bytearray(path.read_bytes())
    start = int(position * len(data))
    data[start : start + 64] = bytes(b ^ 0x55 for b in data[start : start + 64])
    path.write_bytes(data)
    assert digest(load_world("park", 0, cache_folder=tmp_path)) == digest(whole)


def test_foreign_file_is_rebuilt(builds: list[tuple[str, int]], tmp_path: Path) -> None:
    load_world("park", 0, cache_folder=tmp_path)
    (path,) = tmp_path.iterdir()
    for write in (lambda: np.savez(path, other=np.zeros(3)), lambda: path.write_text("not a world")):
        write()
        assert load_world("park", 0, cache_folder=tmp_path).name == "park"
    assert len(builds) == 3


def test_read_only_cache_is_ignored(builds: list[tuple[str, int]], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a file, not a folder")
    assert load_world("park", 0, cache_folder=tmp_path / "file" / "worlds").name == "park"
    assert builds == [("park", 0)]


def test_unknown_environment_lists_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown environment 'bark'; did you mean 'park'"):
        load_world("bark", 0, cache_folder=tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_round_trip_of_a_variant(tmp_path: Path) -> None:
    world = park_variant(1)
    save_world(tmp_path / "w.npz", world)
    assert digest(read_world(tmp_path / "w.npz")) == digest(world)
