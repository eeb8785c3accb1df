# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A run in the rerun viewer: path, photographs with labels, labelled clouds and time series in the sensors' frames.

The entity tree follows ``/tf_static``. All scans are shown, but only ``RATE`` images per second: the viewer keeps all
data in memory, and a tag image takes a megabyte.
"""

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.base_messages import WHEEL_FRAMES
from fieldtruth.bag.reader import RawMessage, decoder, open_bag
from fieldtruth.bag.run import Run, open_run
from fieldtruth.bag.trajectory import read_trajectory
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.errors import OutputError
from fieldtruth.core.files import atomic_output, output_errors
from fieldtruth.core.outputs import output_path
from fieldtruth.core.progress import Progress, Silent, timed
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.report.drawing.vectors import flow_colours, normal_colours
from fieldtruth.sensors.wheel_odometry.config import WHEEL_SPEEDS

RATE: Final = 5.0  # [Hz]
TIMELINE: Final = "time"
BASE: Final = "world/base_link"

_EPOCH_NS: Final = 10**8 * 10**9
"""Larger stamps (three years) are dates, not time since the start."""


def view(path: Path | str, *, save: Path | str | None = None, progress: Progress | None = None) -> None:
    """Show a run in the rerun viewer, or write the recording to a file.

    Args:
        path: folder of a run, or a bag.
        save: an .rrd file to write instead of opening the viewer.
        progress: receives the stages of the work.

    Raises:
        BagError: the bag cannot be read.
        OutputError: rerun is not installed, there is no display, or the file already exists or cannot be written.
    """
    save = None if save is None else output_path(save, endings=(".rrd",), option="--save")
    run = open_run(path)
    if save is None and sys.platform == "linux" and not os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY"}:
        raise OutputError("there is no display for the viewer; use --save FILE.rrd to write a recording")
    rr = _rerun()
    recording = rr.RecordingStream("fieldtruth", recording_id=run.name)
    with ExitStack() as stack:
        if save is None:
            rr.spawn(recording=recording, hide_welcome_screen=True)
        else:
            stack.enter_context(output_errors(save))
            save.parent.mkdir(parents=True, exist_ok=True)
            recording.save(str(stack.enter_context(atomic_output(save))))
        recording.send_blueprint(_blueprint(run))
        _Log(rr, recording, run).everything(Silent() if progress is None else progress)
        recording.flush()
        recording.disconnect()


class _Log:
    """Logs a run to a recording."""

    def __init__(self, rr: Any, recording: Any, run: Run) -> None:
        self.rr, self.recording, self.run = rr, recording, run
        rig = run.rig
        self._last_image = {topic: -_EPOCH_NS for imager in rig.imagers for topic in imager.topics.values()}
        self._imus = dict(zip((imu.topic for imu in rig.imus), _entity_names("imu", rig.imus), strict=True))
        self._antennas = dict(zip((a.topic for a in rig.antennas), _entity_names("gnss", rig.antennas), strict=True))
        self._entities: dict[str, str] = {}
        self._known: set[str] = set()

    def everything(self, progress: Progress) -> None:
        """Log static data, then the messages in time order."""
        rr, run = self.rr, self.run
        described = [rr.AnnotationInfo(int(c.label), c.name, c.rgb) for c in CLASSES if c.rgb is not None]
        self.recording.log("/", rr.AnnotationContext(described), static=True)
        self.recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        static = read.static_transforms(run.bag) if table.TF_STATIC in run.counts else {}
        self._entities = entities(static)
        for (_, child), parent_from_child in static.items():
            self.recording.log(self._entities[child], self._transform(parent_from_child), static=True)
        path = read_trajectory(run).position
        self.recording.log("world/path", rr.LineStrips3D([path[:: max(1, len(path) // 5000)]], radii=0.02), static=True)
        senders = {topic: sender for topic, sender in self._senders().items() if topic in run.counts}
        with (
            progress.stage("log the run", run.duration_s) as advance,
            open_bag(run.bag, true_stamps=run.clocked) as bag,
        ):
            decode = decoder(bag)
            for raw in timed(bag.messages(list(senders)), advance, run.start_ns):
                if not self._is_skipped(raw):
                    self._set_time(raw.stamp_ns)
                    senders[raw.topic](raw.topic, decode(raw))

    def _senders(self) -> dict[str, Any]:
        cameras = {
            imager.topic_of(stream): send
            for imager in self.run.rig.imagers
            for stream, send in (
                ("camera_info", self._camera_info),
                ("photograph", self._photograph),
                ("tag", self._tag),
                ("depth", self._depth),
                ("normals", self._normals),
                ("flow", self._flow),
            )
        }
        return cameras | {
            table.ODOMETRY: self._odometry,
            table.TF: self._wheel_frames,
            **dict.fromkeys((lidar.topic for lidar in self.run.rig.lidars), self._points),
            **dict.fromkeys(self._imus, self._imu),
            **dict.fromkeys(self._antennas, self._navsat),
            **dict.fromkeys(WHEEL_SPEEDS, self._wheel),
        }

    def _is_skipped(self, raw: RawMessage) -> bool:
        if raw.topic not in self._last_image:
            return False
        if raw.stamp_ns - self._last_image[raw.topic] < 0.999e9 / RATE:
            return True
        self._last_image[raw.topic] = raw.stamp_ns
        return False

    def _set_time(self, stamp_ns: int) -> None:
        if stamp_ns < _EPOCH_NS:
            self.recording.set_time(TIMELINE, duration=np.timedelta64(stamp_ns, "ns"))
        else:
            self.recording.set_time(TIMELINE, timestamp=np.datetime64(stamp_ns, "ns"))

    def _entity(self, frame: str) -> str:
        return self._entities.get(frame, f"{BASE}/{frame}")

    def _transform(self, parent_from_child: NDArray[np.float64]) -> Any:
        return self.rr.Transform3D(translation=parent_from_child[:3, 3], mat3x3=parent_from_child[:3, :3])

    def _odometry(self, _: str, message: Any) -> None:
        self.recording.log(BASE, self._transform(read.pose_matrix(message.pose.pose)))
        linear = message.twist.twist.linear
        self._scalar("speed", float(np.linalg.norm([linear.x, linear.y, linear.z])))

    def _wheel_frames(self, _: str, message: Any) -> None:
        for each in message.transforms:
            if each.child_frame_id in WHEEL_FRAMES:
                self.recording.log(self._entity(each.child_frame_id), self._transform(read.matrix(each.transform)))

    def _points(self, _: str, message: Any) -> None:
        cloud = read.points(message)
        names = cloud.dtype.names or ()
        label = cloud["label" if "label" in names else "intensity"].astype(np.uint16)
        xyz = np.stack([cloud["x"], cloud["y"], cloud["z"]], axis=-1)
        entity = f"{self._entity(message.header.frame_id)}/points"
        self.recording.log(entity, self.rr.Points3D(xyz, class_ids=label, radii=self.rr.Radius.ui_points(1.5)))

    def _camera_info(self, _: str, message: Any) -> None:
        entity = self._entity(message.header.frame_id)
        if entity in self._known:
            return
        self._known.add(entity)
        if (
            np.any(message.D) or not message.K[0] or message.distortion_model == "equidistant"
        ):  # rerun has pinholes only; other images are shown flat
            return
        matrix = message.K.reshape(3, 3).copy()
        matrix[:2, 2] += 0.5  # rerun's origin is the corner of the first pixel, that of ROS its centre
        axes, size = self.rr.ViewCoordinates.RDF, {"width": message.width, "height": message.height}
        lens = self.rr.Pinhole(image_from_camera=matrix, camera_xyz=axes, image_plane_distance=1.0, **size)
        self.recording.log(entity, lens, static=True)

    def _photograph(self, _: str, message: Any) -> None:
        entity = f"{self._entity(message.header.frame_id)}/photograph"
        self.recording.log(entity, self.rr.EncodedImage(contents=message.data.tobytes(), media_type="image/jpeg"))

    def _tag(self, _: str, message: Any) -> None:
        label = read.labels(read.image(message))
        image = self.rr.SegmentationImage(label, opacity=0.4, draw_order=1.0)
        self.recording.log(f"{self._entity(message.header.frame_id)}/tag", image)

    def _depth(self, _: str, message: Any) -> None:
        metres = read.depth(message)
        image = self.rr.DepthImage(np.where(np.isfinite(metres), metres, 0.0).astype(np.float32), meter=1.0)
        self.recording.log(f"depth/{message.header.frame_id}", image)

    def _normals(self, _: str, message: Any) -> None:
        self.recording.log(f"normals/{message.header.frame_id}", self.rr.Image(normal_colours(read.normals(message))))

    def _flow(self, _: str, message: Any) -> None:
        self.recording.log(f"flow/{message.header.frame_id}", self.rr.Image(flow_colours(read.flow(message))))

    def _imu(self, topic: str, message: Any) -> None:
        for name in ("angular_velocity", "linear_acceleration"):
            for axis in "xyz":
                self._scalar(f"{self._imus[topic]}/{name}/{axis}", getattr(getattr(message, name), axis))

    def _navsat(self, topic: str, message: Any) -> None:
        self.recording.log(self._antennas[topic], self.rr.GeoPoints(lat_lon=[message.latitude, message.longitude]))

    def _wheel(self, topic: str, message: Any) -> None:
        self._scalar(f"wheels/{topic.rpartition('/')[2].removesuffix('_speed')}", message.data)

    def _scalar(self, name: str, value: float) -> None:
        self.recording.log(f"curves/{name}", self.rr.Scalars(float(value)))


def entities(static: Mapping[tuple[str, str], NDArray[np.float64]]) -> dict[str, str]:
    """Entity path of each frame by name, from the static transforms by (parent, child)."""
    parents = {child: parent for parent, child in static}
    found: dict[str, str] = {}
    for frame in parents:
        chain, above = [frame], parents[frame]
        while above in parents and above not in chain:
            chain.append(above)
            above = parents[above]
        found[frame] = "/".join([BASE, *reversed(chain)])
    return found


def _entity_names(kind: str, sensors: Sequence[SensorConfig]) -> list[str]:
    """Entities of the sensors of a kind: its name if there is one, else a branch for each."""
    return [kind] if len(sensors) == 1 else [f"{kind}/{sensor.name}" for sensor in sensors]


def _blueprint(run: Run) -> Any:
    import rerun.blueprint as rrb

    images = [
        rrb.Spatial2DView(origin=f"{BASE}/{imager.frame}/{imager.optical_frame}", name=f"{imager.name} camera")
        for imager in run.rig.imagers
        if run.counts.keys() & {imager.topic_of("photograph"), imager.topic_of("tag")}
    ]
    views = [("speed", "speed [m/s]")]
    for imu in _entity_names("imu", run.rig.imus):
        of = f" of {imu.removeprefix('imu/')}" if "/" in imu else ""
        views.append((f"{imu}/angular_velocity", f"angular velocity{of} [rad/s]"))
        views.append((f"{imu}/linear_acceleration", f"acceleration{of} [m/s²]"))
    views.append(("wheels", "wheels [rad/s]"))
    curves = [rrb.TimeSeriesView(origin=f"curves/{origin}", name=name) for origin, name in views]
    shown = [rrb.Grid(*images)] if len(images) > 2 else images
    right = rrb.Vertical(*shown, rrb.Tabs(*curves)) if images else rrb.Vertical(*curves)
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Spatial3DView(origin="world", name="world"), right, column_shares=[3, 2]),
        rrb.TimePanel(timeline=TIMELINE),
        collapse_panels=True,
    )


def _rerun() -> Any:
    try:
        import rerun
    except ImportError as error:
        raise OutputError("the viewer is not installed; run: pip install 'fieldtruth[view]'") from error
    return rerun
