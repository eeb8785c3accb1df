# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The LiDAR: its rays, their echoes, and the readings of an ideal and of a real receiver.

Every return has class and instance id. Patterns, timing and figures need no ray tracer.

Rays of LiDARs whose pattern does not repeat from scan to scan; without the ray tracer. Livox publishes no formulas.
These have the fields of view, lines and rates of the data sheets and depend on the time alone, so that the scans of a
LiDAR at rest fill its field of view: the Avia's repeat after 30 s, the Mid-360's never.

Power, noise and beams with a width follow docs/lidar_signal.md, which compares them with a real frame. An echo begins
with the nearest ray that is left, and takes all within ``pulse_length``. Its power is their sum and its range their
mean by power, where the peak of a waveform is that has not separated (Wagner and others 2006, ISPRS Journal 60,
100-112). Class and id are those of the object with most of its power.
"""

from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise
from typing import Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import CLASSES, NO_RETURN, Label
from fieldtruth.core.parallel import in_order
from fieldtruth.core.random import rng_of
from fieldtruth.core.yaml_io import package_data
from fieldtruth.experiment.light_config import WeatherConfig
from fieldtruth.experiment.rig import Box, Cylinder
from fieldtruth.kernels.lidar import (
    TILE_COLUMNS,
    TURNS,
    Beams,
    EchoBuffers,
    Receiver,
    Scan,
    SubRays,
    SurfaceTable,
    collect_returns,
    trace_echoes,
)
from fieldtruth.kernels.lidar_noise import Reading, add_weather, measure
from fieldtruth.kernels.packets import LANES, Grid, SceneRays, new_packet
from fieldtruth.sense.air import LIGHT_SPEED, Beam, make_air
from fieldtruth.sense.interval import Interval
from fieldtruth.sense.robot import REFLECTANCE, RobotScan
from fieldtruth.sense.scene import Scene, by_top, grid_of
from fieldtruth.sensors.lidar.config import LidarConfig, LidarSignal
from fieldtruth.world.model import ROBOT_ID, Material, Raster, Terrain, World
from fieldtruth.world.seasons.change import hidden_share

CLASS_ITSELF: Final = np.arange(256, dtype=np.uint8)
"""Class of a code where the hit table has classes."""
NO_OWNERS: Final = np.zeros(0, np.uint32)
"""Owners where the hit table has instance ids."""
_Points = TypeVar("_Points", Scan, Reading)


def column_times_ns(config: LidarConfig) -> NDArray[np.int64]:
    """Times (columns,) [ns] after the stamp at which the columns of a spinning LiDAR begin."""
    return np.asarray(np.rint(np.arange(config.columns) * (1e9 / config.rate_hz / config.columns)), np.int64)


def sweep_times_ns(config: LidarConfig) -> NDArray[np.int64]:
    """Times (columns + 1,) [ns] after the stamp of ``column_times_ns``, and of the end of the last column."""
    return np.append(column_times_ns(config), round(1e9 / config.rate_hz))


def ray_times_ns(config: LidarConfig) -> NDArray[np.int64]:
    """Times (columns, rings) [ns] after the stamp at which the rays of a spinning LiDAR leave."""
    offsets = np.array(config.firing_offsets_ns or (0,) * config.rings, np.int64)
    return np.asarray(column_times_ns(config)[:, None] + offsets, np.int64)


def ring_lag(config: LidarConfig) -> Array:
    """Share (rings,) of a column's time after which each ring fires."""
    offsets = np.array(config.firing_offsets_ns or (0,) * config.rings)
    return offsets * (1e-9 * config.rate_hz * config.columns)


AVIA_FOV_DEG: Final = (70.4, 77.2)
PRISMS_HZ: Final = (7294.0 / 60.0, -4664.0 / 60.0)
"""Turns of the two prisms of the Mid-40 and the Mid-70: the spectra of their tables of rays (TATP-233/MuJoCo-LiDAR
22c0826, scan_mode) have their two highest peaks there, within 15 a minute."""
MID_360_ELEVATIONS_DEG: Final = (-7.0, 52.0)
MID_360_HZ: Final = (10.0 * 2.0**0.5, 100.0 * 3.0**0.5)
"""Turns of the head and swings of the elevation."""


def pattern_directions(config: LidarConfig, stamp_ns: int) -> Array:
    """Unit directions (columns, rings, 3) in the LiDAR's frame of a scan that begins at ``stamp_ns``.

    All lines of a column, its rings, leave at once.
    """
    seconds = np.asarray((stamp_ns + column_times_ns(config))[:, None] * 1e-9, np.float64)
    lines = np.arange(config.rings)
    return _avia(seconds, lines) if config.pattern == "avia" else _mid_360(seconds, lines)


def _avia(seconds: Array, lines: NDArray[np.int64]) -> Array:
    """Return the rays of lines above each other that two prisms deflect, to the first order: a rosette about +x."""
    width, height = np.radians(AVIA_FOV_DEG)
    turns = [np.exp(2j * np.pi * hz * seconds) for hz in PRISMS_HZ]
    aside = width / 4.0 * (turns[0] + turns[1])  # angle from +x, towards +y (real) and +z (imaginary)
    angle = np.abs(aside)
    slope = np.sinc(angle / np.pi)
    x, y, z = np.cos(angle), slope * aside.real, slope * aside.imag
    up = (height - width) * (lines / max(len(lines) - 1, 1) - 0.5)
    return np.stack([x * np.cos(up) - z * np.sin(up), y + 0.0 * up, x * np.sin(up) + z * np.cos(up)], axis=-1)


def _mid_360(seconds: Array, lines: NDArray[np.int64]) -> Array:
    """Return the rays of lines that are even around a turning head, each of which swings up and down evenly."""
    low, high = np.radians(MID_360_ELEVATIONS_DEG)
    ahead = 2.0 * np.pi * lines / len(lines)
    azimuth = -2.0 * np.pi * MID_360_HZ[0] * seconds - ahead
    swing = np.arcsin(np.sin(2.0 * np.pi * MID_360_HZ[1] * seconds + ahead)) / np.pi  # -0.5 to 0.5
    elevation = (low + high) / 2.0 + (high - low) * swing
    horizontal = np.cos(elevation)
    return np.stack([horizontal * np.cos(azimuth), horizontal * np.sin(azimuth), np.sin(elevation)], axis=-1)


def ray_directions(config: LidarConfig, stamp_ns: int = 0) -> Array:
    """Unit directions (columns, rings, 3) in the LiDAR's frame (x forward, y left, z up).

    Column 0 points along +x; columns are 360 deg / columns apart and advance clockwise seen from above, as an Ouster
    rotates. A ring leaves its column by its azimuth offset, and by what the head turns until it fires. Those of a
    ``pattern`` are of the scan at ``stamp_ns``.
    """
    if config.pattern is not None:
        return pattern_directions(config, stamp_ns)
    ahead = np.radians(np.array(config.azimuth_offsets_deg or (0.0,)))  # (rings,) or (1,), clockwise
    ahead = ahead + 2.0 * np.pi * config.rate_hz * 1e-9 * np.array(config.firing_offsets_ns or (0,))
    azimuth = (-2.0 * np.pi * np.arange(config.columns) / config.columns)[:, None] - ahead
    elevation = config.ring_elevations
    directions = np.empty((config.columns, config.rings, 3))
    directions[..., 0] = np.cos(azimuth) * np.cos(elevation)
    directions[..., 1] = np.sin(azimuth) * np.cos(elevation)
    directions[..., 2] = np.sin(elevation)
    return directions


def _new_scan(count: int) -> Scan:
    kinds = (np.float32, np.uint8, np.uint32, np.uint16, np.uint16, np.uint32, np.uint32, np.uint8)
    return Scan(np.empty((count, 3), np.float32), *(np.zeros(count, kind) for kind in kinds))  # type: ignore[arg-type]


SNOW: Final = 0.85
"""Reflectance of snow at 850 to 905 nm, grains of 0.3 mm (from memory of Wiscombe and Warren 1980, figure 8)."""


def below_snow(value: float, share: float) -> float:
    """Reflectance of a ground of which snow hides a share."""
    return value + share * (SNOW - value)


def ground_below_snow(bare: Raster, terrain: Terrain) -> Raster:
    """Reflectances of a terrain's ground with its snow, on the grid of those without; snow elsewhere does not count."""
    if terrain.snow is None:
        return bare
    x, y = _nodes(bare)
    share = hidden_share(terrain).at(x, y)
    values = bare.values + share * (SNOW - bare.values)
    return Raster(values=values.astype(np.float32), spacing=bare.spacing, x0=bare.x0, y0=bare.y0)


def snow_on_trails(terrain: Terrain) -> float:
    """Share of the trails that snow hides."""
    inside = terrain.trail_distance.values < 0
    if terrain.snow is None or not inside.any():
        return 0.0
    x, y = _nodes(terrain.trail_distance)
    return float(hidden_share(terrain).at(x[inside], y[inside]).mean())


def _nodes(raster: Raster) -> list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    nx, ny = raster.values.shape
    axes = raster.x0 + raster.spacing * np.arange(nx), raster.y0 + raster.spacing * np.arange(ny)
    return list(np.meshgrid(*axes, indexing="ij"))


class Reflectance(NamedTuple):
    """Share of the light that a surface reflects, and how much of that in a lobe about the mirrored direction."""

    value: float
    gloss: float = 0.0
    """Share ks of what is reflected that is in the lobe (Jutzi and Gross 2009)."""
    exponent: float = 1.0
    """Exponent n of the lobe |cos 2 theta|^n."""


@cache
def _table() -> dict[str, dict[str, Reflectance]]:
    return {
        section: {
            name: Reflectance(*(float(entry[key]) for key in ("value", "gloss", "exponent") if key in entry))
            for name, entry in entries.items()
        }
        for section, entries in package_data("fieldtruth.sensors.lidar", "reflectance.yaml").items()
    }


def reflectance_of(material: Material) -> Reflectance:
    """Reflectance of a material: its own; else of its ground type, of its texture, of its class."""
    if material.reflectance is not None:
        return Reflectance(material.reflectance)
    table = _table()
    found = (
        table["materials"].get(material.name),
        table["ground_types"].get(material.ground_type),
        table["textures"].get(material.texture),
    )
    name = CLASSES[material.label].key if material.label < len(CLASSES) else "void"  # of a class of a user's own
    return next((each for each in found if each is not None), table["classes"][name])


def echo_buffers(echoes: int, columns: int, rings: int) -> EchoBuffers:
    """Return empty buffers."""
    shape = (echoes, columns, rings)
    return EchoBuffers(
        label=np.zeros(shape, np.uint8),
        instance=np.zeros(shape, np.uint32),
        depth=np.zeros(shape, np.float32),
        apparent=np.zeros(shape, np.float32),
        mixed=np.zeros(shape, np.bool_),
        clear=np.zeros(shape[1:], np.float32),
        true_range=np.zeros(shape[1:], np.float32),
    )


def surface_table(scene: Scene) -> SurfaceTable:
    """Reflectances of a scene's surfaces, in the order of its ``hits``."""
    world = scene.world
    rows = {name: row for row, name in enumerate(world.materials)}
    faces = [np.array([rows[n] for n in mesh.materials], np.uint16)[mesh.material] for mesh in scene.meshes]
    rotation = np.array([top.world_from_object[:3, :3] for top in scene.top_levels])
    terrain, on_trail = world.terrain, snow_on_trails(world.terrain)
    trails = [reflectance_of(world.materials[name]).value for name in terrain.trail_materials]
    trail, border = (below_snow(value, on_trail) for value in trails) if trails else (-1.0, -1.0)
    return SurfaceTable(
        face_material=np.concatenate([*faces, np.zeros(0, np.uint16)]),
        material=np.array([reflectance_of(material) for material in world.materials.values()], np.float32),
        top_rotation=(rotation / np.linalg.norm(rotation[:, :, :1], axis=1, keepdims=True)).astype(np.float32),
        ground=_ground(world),
        trail=trail,
        border=border,
        border_width=terrain.border_width,
    )


def _ground(world: World) -> Grid:
    """Mean reflectance of the materials of the ground by their weights."""
    cover = world.terrain.cover
    values = [reflectance_of(world.materials[name]).value for name in world.terrain.ground_materials]
    weights = cover.values / np.maximum(cover.values.sum(axis=-1, keepdims=True), 1e-6)
    mixed = (weights @ np.array(values)).astype(np.float32)
    bare = Raster(values=mixed, spacing=cover.spacing, x0=cover.x0, y0=cover.y0)
    return grid_of(ground_below_snow(bare, world.terrain))


def new_reading(count: int) -> Reading:
    """Return an empty reading of so many points."""
    ids = (np.float32, np.uint8, np.uint32, np.uint16, np.uint16, np.uint32)
    kinds = (*ids, *3 * (np.float32,), *2 * (np.uint8,), np.uint32, np.uint8)
    return Reading(np.zeros((count, 3), np.float32), *(np.zeros(count, kind) for kind in kinds))  # type: ignore[arg-type]


def limit_of(signal: LidarSignal) -> float:
    """Apparent reflectance over squared range [1/m^2] at which half of the pulses return; 0 if all return.

    The pairs of a data sheet are one figure, rounded twice: 80 % at 120 m and 10 % at 40 m differ by 12 % in power, and
    their mean in logarithm by 3 % in range from either. (It is no extinction, which would make the far one weaker.)
    """
    return float(np.exp(np.mean([np.log(rho / r**2) for rho, r in signal.reach]))) if signal.reach else 0.0


def receiver_of(signal: LidarSignal) -> Receiver:
    """Constants of a signal."""
    limit = limit_of(signal)
    noise = np.log(np.array(signal.range_noise, np.float64).reshape(-1, 2))
    return Receiver(
        gain=signal.signal_at_reach / limit if limit else 0.0,
        threshold=signal.signal_at_reach,
        log_signal=np.ascontiguousarray(noise[:, 0]),
        log_deviation=np.ascontiguousarray(noise[:, 1]),
        resolution=signal.resolution,
        angle=float(np.radians(signal.angle_noise_deg)),
    )


def beam_of(config: LidarConfig) -> Beam:
    """Return the beam of a LiDAR with a signal."""
    signal = config.signal
    assert signal is not None
    return Beam(
        wavelength_nm=signal.wavelength_nm,
        width_m=signal.beam_diameter,
        divergence_rad=float(np.radians(signal.divergence_deg)),
        pulse_ns=2e9 * signal.pulse_length / LIGHT_SPEED,
        min_range=config.min_range,
        max_range=config.max_range,
        gain=receiver_of(signal).gain,
    )


class WeatherInAir:
    """Changes the echoes of a LiDAR's scans as the weather does; see ``InAir``. Threads may share it."""

    def __init__(self, config: LidarConfig, weather: WeatherConfig, lowest: float = 0.0) -> None:
        """``lowest`` is the height [m] of the lowest ground, where fog that thins with height is densest."""
        assert config.signal is not None
        self._lowest = lowest
        self._air = make_air(weather, beam_of(config))
        # Of the last echo, a particle's counts only where the surface behind it cannot be detected.
        self._least = limit_of(config.signal) if config.signal.returns == "last" else np.inf

    def __call__(self, echoes: EchoBuffers, key: np.uint64, poses: Array, directions: Array) -> None:
        """Change the echoes of the scan with this key, made by beams of these directions at these poses."""
        upwards = np.concatenate([poses[:, 2, :3], poses[:, 2, 3:] - self._lowest], axis=1)
        add_weather(self._air, self._least, key, upwards, directions, echoes)


def sub_rays_of(
    signal: LidarSignal,
    class_of: NDArray[np.uint8] = CLASS_ITSELF,
    object_of: NDArray[np.uint32] = NO_OWNERS,
) -> SubRays:
    """Rays of a beam of a signal: one, or at least three of them; see ``SubRays`` for the tables.

    A beam's irradiance is a Gaussian of the angle, exp(-r^2 / 2 s^2) with s = FWHM / sqrt(8 ln 2). One ray in its
    middle with half of the power, and the others in a ring of radius 2 s with the rest, have its moments up to the
    fifth degree with six rays in the ring (Stroud 1971, Approximate calculation of multiple integrals, E2-r2 5-1), and
    its second and fourth radial ones with any number. The ring is turned from beam to beam, so that two rays in it see
    no direction more than others.
    """
    count = signal.sub_rays
    radius = 2.0 * np.radians(signal.divergence_deg) / np.sqrt(8.0 * np.log(2.0))
    ring = np.arange(count - 1) + np.arange(TURNS)[:, None] / TURNS  # (TURNS, count - 1) of its spacing
    angle = 2.0 * np.pi * ring / max(count - 1, 1)
    offset = np.zeros((TURNS, count, 2))
    offset[:, 1:] = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    memory, receiver = LANES * count, receiver_of(signal)
    return SubRays(
        offset=offset,
        scale=float(1.0 / np.sqrt(1.0 + radius**2)),
        weight=np.array([0.5, *(count - 1) * (0.5 / (count - 1),)] if count > 1 else [1.0]),
        choice=("strongest", "last", "two").index(signal.returns),
        pulse_length=signal.pulse_length,
        gain=receiver.gain,
        threshold=receiver.threshold,
        packets=(new_packet(coherent=False), new_packet(coherent=True)),  # the first 12 % faster in the park
        origin=np.zeros((memory, 3)),
        direction=np.zeros((memory, 3)),
        time=np.zeros(memory),
        range_m=np.zeros(memory),
        clear=np.zeros(memory),
        power=np.zeros(memory),
        code=np.zeros(memory, np.int64),
        owner=np.zeros(memory, np.int64),
        label=np.zeros(memory, np.int64),
        instance=np.zeros(memory, np.int64),
        order=np.zeros(count, np.int64),
        class_of=class_of,
        object_of=object_of,
    )


_ROBOT: Final = np.array(REFLECTANCE)
InAir = Callable[[EchoBuffers, np.uint64, Array, Array], None]
"""Changes echoes as the air between LiDAR and surfaces does: ``apparent`` falls by exp(-2 alpha R), and a particle that
returns more takes the echo with its own ``depth``, ``apparent``, ``label`` and ``instance``. ``true_range`` stays. What
it draws depends on the key, which is that of the scan. The arrays are poses (columns + 1, 4, 4) and directions
(columns, rings, 3) of the beams."""


class Traced(NamedTuple):
    """Poses of a scan, and whether the sensor moves; its echoes are in the buffers of the LiDAR."""

    poses: Array
    moving: bool


class IdealLidar:
    """An ideal LiDAR in a scene, whatever its configuration's signal. Use one per thread: each owns its buffers.

    The origin is the frame ``os1_lidar``. A ray returns the first surface between ``min_range`` and ``max_range``; a
    nearer surface occludes those behind it without a return; water and sky return nothing. All rays of a scan leave at
    the scan's stamp unless poses by column are given to ``scan``. Range is exact: no noise, no beam divergence.
    ``robot`` is what it sees of the robot that carries it (``experiment.rig.visible_parts``).
    """

    def __init__(self, config: LidarConfig, scene: Scene, robot: Sequence[Box | Cylinder] = ()) -> None:
        self.config = config
        self.scene = scene
        self._times_ns = ray_times_ns(config)
        returns = np.ones(256, np.bool_)
        returns[[int(label) for label in NO_RETURN]] = False
        directions, time = ray_directions(config), np.zeros(config.columns + 1)
        self._beams = Beams(directions, ring_lag(config), config.min_range, config.max_range, returns, time)
        self._codes = scene.part_codes if config.parts else None
        self._hits = scene.hits if self._codes is None else self._codes.hits
        self._owners = NO_OWNERS
        if config.passability:
            self._hits, self._owners = by_top(self._hits), scene.owners
        self._tables = CLASS_ITSELF if self._codes is None else self._codes.label, self._owners
        self._rays, self._middle = sub_rays_of(LidarSignal(), *self._tables), sub_rays_of(LidarSignal())
        self.workers = 1
        """Threads that trace a scan together; they change no bit of it."""
        self._others = list[SubRays]()  # memory of the other threads
        self._surfaces: SurfaceTable | None = None
        self._echoes = echo_buffers(1, config.columns, config.rings)
        self._robot = RobotScan(robot, config, self._beams.directions) if robot else None

    def scan(self, world_from_lidar: Array, stamp_ns: int = 0, number: int = 0) -> Scan:
        """Scan from a pose (4, 4), or of a sensor that moves from those at each column's beginning and at the end.

        With poses (columns + 1, 4, 4), ``t_ns`` spreads the columns evenly over one period, and each point is in the
        frame of the LiDAR when its ray leaves, as a real scanner reports it. Rings that fire later than their column
        begins have a pose between its pose and the next one, interpolated linearly. The stamp matters to a LiDAR with
        a ``pattern`` and where bodies move, and the number of the scan to one with a signal.

        Raises:
            ValueError: another number of poses.
        """
        traced = self.trace(world_from_lidar, stamp_ns)
        found = _new_scan(int(np.count_nonzero(self._echoes.depth)))
        collect_returns(self._beams.directions, self._echoes, found)
        if traced.moving:
            found.t_ns[:] = self._times_ns[found.column, found.ring]
        return self._decoded(found)

    def _decoded(self, found: _Points) -> _Points:
        """Return points whose classes and instance ids, which were codes and rows, are these and what the codes say."""
        if self._codes is not None:
            found = found._replace(part=self._codes.decode(found.label))
        if len(self._owners):
            found = found._replace(instance=np.take(self._owners, found.instance), top=found.instance)
        return found

    def trace(self, world_from_lidar: Array, stamp_ns: int) -> Traced:
        """Fill the buffers of echoes from poses, as ``scan`` takes them.

        Raises:
            ValueError: another number of poses.
        """
        config = self.config
        if config.pattern is not None:
            self._beams = self._beams._replace(directions=ray_directions(config, stamp_ns))
        moving = world_from_lidar.ndim == 3
        if moving and len(world_from_lidar) != config.columns + 1:
            raise ValueError(f"poses must be {config.columns + 1}, one more than columns, got {len(world_from_lidar)}")
        poses = np.ascontiguousarray(np.broadcast_to(world_from_lidar, (config.columns + 1, 4, 4)))
        interval = self._interval(poses, stamp_ns, moving)
        self._trace_columns(interval.rays, poses)
        if self._robot is not None:
            self._echo_of_robot(self._robot, poses, interval)
        return Traced(poses, moving)

    def _trace_columns(self, scene: SceneRays, poses: Array) -> None:
        """Fill the buffers of echoes, each thread a span of columns."""
        hits, columns = self._hits, self.config.columns
        tiles = -(-columns // TILE_COLUMNS)
        bounds = [min(tiles * k // self.workers * TILE_COLUMNS, columns) for k in range(self.workers + 1)]
        while len(self._others) < self.workers - 1:
            self._others.append(sub_rays_of(self.config.signal or LidarSignal(), *self._tables))

        def trace(work: tuple[SubRays, tuple[int, int]]) -> None:
            trace_echoes(scene, hits, self._surfaces, poses, self._beams, *work, self._echoes)

        works = zip([self._rays, *self._others], pairwise(bounds), strict=False)
        for _ in in_order(works, trace, self.workers) if self.workers > 1 else map(trace, works):
            pass

    def _interval(self, poses: Array, stamp_ns: int, moving: bool) -> Interval:
        """Return what moves during a scan from poses, and set the times of the beams."""
        if not self.scene.moves:
            return self.scene.interval(stamp_ns, stamp_ns, poses[0, :3, 3], 0.0)
        stamps = stamp_ns + sweep_times_ns(self.config) * moving
        reach = self.config.max_range + float(np.linalg.norm(poses[:, :3, 3] - poses[0, :3, 3], axis=1).max())
        interval = self.scene.interval(int(stamps[0]), int(stamps[-1]), poses[0, :3, 3], reach)
        self._beams = self._beams._replace(time=interval.share(stamps))
        return interval

    def _echo_of_robot(self, robot: RobotScan, poses: Array, interval: Interval) -> None:
        """Put the robot's echoes instead of those of what it hides; what is too near makes none."""
        seen, echoes = self._robot_before(robot, poses, interval), self._echoes
        beam = slice(None), robot.column[seen], robot.ring[seen]
        echoes.depth[beam], echoes.mixed[beam] = 0.0, False
        first, range_m = (0, *beam[1:]), robot.range_m[seen]
        range_m = np.where(range_m < self.config.min_range, np.float32(0.0), range_m)
        echoes.depth[first] = echoes.true_range[beam[1:]] = range_m
        echoes.label[first], echoes.instance[first] = int(Label.ROBOT), ROBOT_ID
        echoes.apparent[first] = (_ROBOT[robot.material] * robot.cosine)[seen]

    def _robot_before(self, robot: RobotScan, poses: Array, interval: Interval) -> Mask:
        """Return whether nothing is before the robot on each of its rays (n,), which alone are traced again."""
        if self.config.pattern is not None:
            robot.aim(self._beams.directions)
        column, ring, range_m = robot.column, robot.ring, robot.range_m
        if not len(column):
            return np.zeros(0, np.bool_)
        lag, time = self._beams.lag[ring], self._beams.time
        own = poses[column] + lag[:, None, None] * (poses[column + 1] - poses[column])
        times = np.append(time[column] + lag * (time[column + 1] - time[column]), 0.0)
        rays = np.ascontiguousarray(self._beams.directions[column, ring][:, None])
        beams = Beams(rays, np.zeros(1), 0.0, float(range_m.max()), np.ones(256, np.bool_), times)
        before = echo_buffers(1, len(column), 1)
        trace_echoes(interval.rays, self.scene.hits, None, own, beams, self._middle, (0, len(column)), before)
        world_m = before.depth[0, :, 0]
        return np.asarray((world_m == 0.0) | (range_m < world_m))


class Lidar(IdealLidar):
    """A LiDAR in a scene, that measures as its configuration says. Use one per thread: each owns its buffers.

    Without a ``signal`` it is ideal (``IdealLidar``) and no weather reaches it. Of a signal with one ray per beam,
    labels, instance ids and ``true_range`` of the points are those of the ideal LiDAR, to the last bit; some of its
    points are missing. With more rays ``true_range`` still is, and class and id are those of the surface that makes the
    echo.

    Args:
        config: with or without a signal.
        scene: what it sees.
        robot: what it sees of the robot that carries it (``experiment.rig.visible_parts``).
        weather: what is in the air.
        in_air: instead of the weather, what the air does to echoes.
        seed: of the noise; None takes that of the world.
    """

    def __init__(
        self,
        config: LidarConfig,
        scene: Scene,
        robot: Sequence[Box | Cylinder] = (),
        weather: WeatherConfig | None = None,
        *,
        in_air: InAir | None = None,
        seed: int | None = None,
    ) -> None:
        super().__init__(config, scene, robot)
        signal = config.signal
        if signal is None:
            return
        if in_air is None and weather is not None and not weather.is_clear:
            in_air = WeatherInAir(config, weather, float(scene.world.terrain.surface.heights.min()))
        self._in_air = in_air
        self._seed = scene.world.seed if seed is None else seed
        self._receiver, self._surfaces = receiver_of(signal), surface_table(scene)
        self._rays = sub_rays_of(signal, *self._tables)
        self._echoes = echo_buffers(2 if signal.returns == "two" else 1, config.columns, config.rings)
        self._points = new_reading(self._echoes.depth.size)

    def scan(self, world_from_lidar: Array, stamp_ns: int = 0, number: int = 0) -> Scan | Reading:  # type: ignore[override]
        """Scan ``number`` of a drive, from poses as ``IdealLidar.scan`` takes them; with a signal, a ``Reading``.

        Raises:
            ValueError: another number of poses.
        """
        if self.config.signal is None:
            return super().scan(world_from_lidar, stamp_ns, number)
        return self.measured(world_from_lidar, stamp_ns, number)

    def measured(self, world_from_lidar: Array, stamp_ns: int = 0, number: int = 0) -> Reading:
        """Scan as ``scan`` does, with a LiDAR that has a signal."""
        return self.measure(self.trace(world_from_lidar, stamp_ns), number)

    def measure(self, traced: Traced, number: int) -> Reading:
        """Return what air and receiver make of the echoes that were traced last, in scan ``number`` of a drive."""
        key = self._key(number)
        if self._in_air is not None:
            self._in_air(self._echoes, key, traced.poses, self._beams.directions)
        count = measure(self._receiver, key, self._beams.directions, self._echoes, self._points)
        found = Reading._make(values[:count].copy() for values in self._points)
        if traced.moving:
            found.t_ns[:] = self._times_ns[found.column, found.ring]
        return self._decoded(found)

    def echoes(self, world_from_lidar: Array, stamp_ns: int = 0) -> EchoBuffers:
        """Echoes before what the air and the receiver make of them; overwritten by the next scan."""
        self.trace(world_from_lidar, stamp_ns)
        return self._echoes

    def _key(self, number: int) -> np.uint64:
        """Key of what a scan draws: it depends on the seed, the LiDAR's name and the scan's number."""
        return rng_of(self._seed, self.config.name, "scan", number).integers(1 << 64, dtype=np.uint64)
