# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A live simulation in a viewer of rerun: the world as boxes, the robot, clouds by class, images, IMU and speed.

The viewer is a server, and this is its client: nothing listens here, and no command comes from there. A viewer that is
closed ends nothing: what is sent is lost.
"""

import socket
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from fieldtruth.bag import decode as read
from fieldtruth.bag.messages import STORE, WORLD
from fieldtruth.bag.topics import CLOCK, ODOMETRY, TF_STATIC
from fieldtruth.core.errors import OutputError
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.live.loop import LOOPBACK, Sink
from fieldtruth.live.messages import Message
from fieldtruth.live.scene import ground_triangles, hull_boxes, object_boxes
from fieldtruth.report.viewer import BASE, TIMELINE, end_recording, entities, rerun_library
from fieldtruth.world.model import World

PORT: Final = 9876
"""Where a viewer listens by default."""


class RerunSink(Sink):
    """A viewer that runs: ``rerun --bind 127.0.0.1``.

    Args:
        host: address of the viewer.
        port: of the viewer.

    Raises:
        OutputError: the library is missing, or no viewer listens there.
    """

    def __init__(self, host: str = LOOPBACK, port: int = PORT) -> None:
        self._rr, self._url = rerun_library(), f"rerun+http://{host}:{port}/proxy"
        try:
            socket.create_connection((host, port), timeout=5.0).close()
        except OSError as error:
            raise OutputError(
                f"no viewer of rerun listens on port {port} of {host}: {error}; run: rerun --bind 127.0.0.1"
            ) from error
        self.where = f"{self._url}, a viewer that listens there"
        self._types, self._entities, self._begun = dict[str, str](), dict[str, str](), 0
        self._recording: Any = None
        self._logs: dict[str, Callable[[str, Any], None]] = {
            "sensor_msgs/msg/PointCloud2": self._cloud,
            "sensor_msgs/msg/CompressedImage": self._photograph,
            "sensor_msgs/msg/Image": self._image,
            "sensor_msgs/msg/Imu": self._inertial,
        }

    def advertise(self, topics: Sequence[Topic]) -> None:
        """Take note of the types."""
        self._types = {topic.name: topic.msgtype for topic in topics}

    def show(self, world: World, rig: Rig) -> None:
        """Begin a recording with world and robot: a viewer orders by time, which begins anew."""
        rr, boxes, hull = self._rr, object_boxes(world), hull_boxes(rig)
        self.close()
        self._begun += 1
        self._recording = rr.RecordingStream("fieldtruth", recording_id=f"{world.name}-{id(self):x}-{self._begun}")
        self._recording.connect_grpc(self._url)
        classes = [rr.AnnotationInfo(int(each.label), each.name, each.rgb) for each in world.classes.coloured]
        self._log("/", rr.AnnotationContext(classes), static=True)
        self._log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        points, triangles = ground_triangles(world)
        self._log("world/ground", rr.Mesh3D(vertex_positions=points, triangle_indices=triangles), static=True)
        if boxes:
            shown = rr.Boxes3D(
                centers=[box.centre for box in boxes],
                sizes=[box.size for box in boxes],
                quaternions=[np.roll(box.quaternion_wxyz, -1) for box in boxes],
                class_ids=[int(box.label) for box in boxes],
            )
            self._log("world/objects", shown, static=True)
        body = rr.Boxes3D(centers=[centre for centre, _ in hull], sizes=[size for _, size in hull])
        self._log(f"{BASE}/body", body, static=True)

    def wants(self, topic: str) -> bool:
        """Return whether it is shown."""
        return topic in {CLOCK, ODOMETRY, TF_STATIC} or self._types[topic] in self._logs

    def send(self, message: Message) -> None:
        """Log a message."""
        self._recording.set_time(TIMELINE, duration=np.timedelta64(message.stamp_ns, "ns"))
        if message.topic == CLOCK:
            return
        msgtype = self._types[message.topic]
        content: Any = STORE.deserialize_ros1(message.data, msgtype)
        if message.topic == TF_STATIC:
            self._frames(content)
        elif message.topic == ODOMETRY:
            self._log(BASE, self._transform(read.pose_matrix(content.pose.pose)))
            self._log("curves/speed", self._rr.Scalars(float(content.twist.twist.linear.x)))
        else:
            self._logs[msgtype](message.topic, content)

    def close(self) -> None:
        """Send what waits, and end the recording."""
        if self._recording is not None:
            end_recording(self._recording)

    def _log(self, entity: str, shown: Any, *, static: bool = False) -> None:
        self._recording.log(entity, shown, static=static)

    def _transform(self, parent_from_child: Any) -> Any:
        return self._rr.Transform3D(translation=parent_from_child[:3, 3], mat3x3=parent_from_child[:3, :3])

    def _entity(self, message: Any) -> str:
        frame = message.header.frame_id
        return self._entities.get(frame, f"{BASE}/{frame}")

    def _frames(self, message: Any) -> None:
        static = {
            (each.header.frame_id, each.child_frame_id): read.matrix(each.transform)
            for each in message.transforms
            if each.child_frame_id != WORLD  # its place on the earth is not shown
        }
        self._entities = entities(static)
        for (_, child), matrix in static.items():
            self._log(self._entities[child], self._transform(matrix), static=True)

    def _cloud(self, topic: str, message: Any) -> None:
        points = read.points(message)
        xyz = np.stack([points[axis] for axis in "xyz"], axis=-1)
        shown = self._rr.Points3D(
            xyz, class_ids=points["label"].astype(np.uint16), radii=self._rr.Radius.ui_points(1.5)
        )
        self._log(f"{self._entity(message)}/points", shown)

    def _photograph(self, topic: str, message: Any) -> None:
        self._log(f"images{topic}", self._rr.EncodedImage(contents=message.data.tobytes(), media_type="image/jpeg"))

    def _image(self, topic: str, message: Any) -> None:
        if message.encoding == "32FC1":
            self._log(f"images{topic}", self._rr.DepthImage(read.depth(message), meter=1.0))
        elif message.encoding in {"rgb8", "bgr8"}:
            self._log(f"images{topic}", self._rr.Image(read.image(message)))

    def _inertial(self, topic: str, message: Any) -> None:
        for what in ("angular_velocity", "linear_acceleration"):
            vector = getattr(message, what)
            for axis in "xyz":
                self._log(f"curves{topic}/{what}/{axis}", self._rr.Scalars(float(getattr(vector, axis))))
