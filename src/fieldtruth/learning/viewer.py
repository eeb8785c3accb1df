# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Episodes in the rerun viewer while they are driven: ground, goal, planner's path, robot, and what it senses."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Cloud
from fieldtruth.drive.routes import NODE
from fieldtruth.drive.traversability import Blockage
from fieldtruth.learning.robot import Now
from fieldtruth.learning.task_world import OBSTACLE_HEIGHT, TaskWorld
from fieldtruth.learning.tasks import Task
from fieldtruth.report.viewer import BASE, TIMELINE, check_display, end_recording, rerun_library

_GROUND, _OBSTACLE, _PATH = (110, 120, 90), (170, 70, 50), (255, 200, 0)


class Viewer:
    """A recording to which the viewer listens; its time goes on over episodes.

    Raises:
        OutputError: rerun is not installed, or there is no display.
    """

    def __init__(self) -> None:
        rerun = self._rr = rerun_library()
        check_display("use render_mode 'rgb_array', or none")
        self._recording: Any = rerun.RecordingStream("fieldtruth")
        rerun.spawn(recording=self._recording, hide_welcome_screen=True)
        self._since = self._last = 0.0  # [s]

    def begin(self, made: TaskWorld, task: Task) -> None:
        """Show the ground around an episode, its goal and the planner's path."""
        rr, self._since = self._rr, self._last
        self._recording.set_time(TIMELINE, duration=self._since)
        robot, classes = made.rig.robot, made.world.classes.coloured
        self._recording.log(
            "/", rr.AnnotationContext([rr.AnnotationInfo(int(c.label), c.name, c.rgb) for c in classes])
        )
        length, width, height = robot.outline
        body = rr.Boxes3D(sizes=[[length, width, height]], centers=[[0.0, 0.0, height / 2 - robot.ground_clearance]])
        self._recording.log(f"{BASE}/body", body)
        self._recording.log("world/ground", self._ground(made, task))
        path = [] if task.goal is None else [self._above(made, _path(task))]
        self._recording.log("world/path", rr.LineStrips3D(path, colors=[_PATH], radii=0.05))
        goal = np.empty((0, 3)) if task.goal is None else self._above(made, task.goal[None])
        self._recording.log("world/goal", rr.Points3D(goal, colors=[_PATH], radii=0.3))

    def show(self, seconds: float, now: Now, cloud: tuple[Cloud, Array] | None, seen: Mapping[str, Any]) -> None:
        """Show the robot after a step: ``seconds`` of the episode, a cloud with its base_from_lidar, observations."""
        rr, self._last = self._rr, self._since + seconds
        self._recording.set_time(TIMELINE, duration=self._last)
        pose = now.world_from_base
        self._recording.log(BASE, rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        if cloud is not None:
            points = cloud[0].xyz @ cloud[1][:3, :3].T + cloud[1][:3, 3]
            self._recording.log(f"{BASE}/lidar", rr.Points3D(points, class_ids=cloud[0].label))
        for name, make in (("camera/photo", rr.Image), ("camera/label", rr.SegmentationImage)):
            if name in seen:
                self._recording.log(name, make(seen[name]))

    def close(self) -> None:
        """Send what is left."""
        end_recording(self._recording)

    def _ground(self, made: TaskWorld, task: Task) -> Any:
        """Mesh of the planner's nodes; obstacles stand out as in the map of heights."""
        nx, ny = task.lengths.shape
        xy = task.corner + NODE * np.stack(np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij"), -1).reshape(-1, 2)
        solid = made.ground.blockage_at(xy) == Blockage.OBSTACLE
        xyz = self._above(made, xy) + np.array([0.0, 0.0, OBSTACLE_HEIGHT]) * solid[:, None]
        first = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).reshape(-1, 1)
        triangles = np.concatenate([first + np.array(corners) for corners in ([0, ny, 1], [ny, ny + 1, 1])])
        colours = np.where(solid[:, None], _OBSTACLE, _GROUND).astype(np.uint8)
        return self._rr.Mesh3D(vertex_positions=xyz, triangle_indices=triangles, vertex_colors=colours)

    def _above(self, made: TaskWorld, xy: Array) -> Array:
        """Points (n, 3) on the ground."""
        return np.column_stack([xy, made.world.terrain.field.height_at(xy[:, 0], xy[:, 1])])


def _path(task: Task) -> Array:
    """Points (n, 2) of the planner's path, a metre or two apart."""
    points = [task.start]
    while task.left(points[-1]) > 1.0 and (ahead := task.ahead(points[-1])) is not None:
        points.append(ahead)
    return np.array(points)
