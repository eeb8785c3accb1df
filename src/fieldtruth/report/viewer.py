# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A run in the rerun viewer: path, photographs with labels, labelled clouds and time series in the sensors' frames.

The entity tree follows ``/tf_static``. All scans are shown, but only ``RATE`` images per second: the viewer keeps all
data in memory, and a tag image takes a megabyte.
"""

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.geometry import Lens
from fieldtruth.bag.messages import WHEEL_FRAMES, WORLD
from fieldtruth.bag.readings import Readings
from fieldtruth.bag.run import Run, open_run
from fieldtruth.core.errors import OutputError
from fieldtruth.core.files import atomic_output, output_errors, output_path
from fieldtruth.core.progress import Progress, Silent, counted
from fieldtruth.core.readings import Cloud, Fix, Image, Inertial, Message, WheelSpeeds
from fieldtruth.report.drawing.images import flow_colours, normal_colours

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
    if save is None:
        check_display("use --save FILE.rrd to write a recording")
    rr = rerun_library()
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
        if save is None:
            end_recording(recording)
        else:
            recording.flush()
            recording.disconnect()


class _Log:
    """Logs a run to a recording."""

    def __init__(self, rr: Any, recording: Any, run: Run) -> None:
        self.rr, self.recording, self.run = rr, recording, run
        self._entities: dict[str, str] = {}

    def everything(self, progress: Progress) -> None:
        """Log static data, then the messages in time order."""
        rr, run = self.rr, self.run
        described = [rr.AnnotationInfo(int(c.label), c.name, c.rgb) for c in run.classes.coloured]
        self.recording.log("/", rr.AnnotationContext(described), static=True)
        self.recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        parents = dict(run.calibration.static.parents) if table.TF_STATIC in run.counts else {}
        parents.pop(WORLD, None)  # its place on the earth is not shown
        self._entities = entities({(parent, child): matrix for child, (parent, matrix) in parents.items()})
        for child, (_, parent_from_child) in parents.items():
            self.recording.log(self._entities[child], self._transform(parent_from_child), static=True)
        path = run.trajectory.position
        self.recording.log("world/path", rr.LineStrips3D([path[:: max(1, len(path) // 5000)]], radii=0.02), static=True)
        for view in run.of(Image, recorded=False):
            if run.calibration.has_lens(view.name):
                self._lens(run.calibration.lens(view.name))
        others = ((table.ODOMETRY, self._odometry), (table.TF, self._wheel_frames))
        logged = [*self._sensors(), *((run.messages(topic), send) for topic, send in others if topic in run.counts)]
        jobs = [(stamp, k, row) for k, (each, _) in enumerate(logged) for row, stamp in _shown(each)]
        with progress.stage("log the run", run.duration_s) as advance:
            for stamp, k, row in counted(sorted(jobs), advance, run.duration_s, len(jobs)):
                readings, send = logged[k]
                self._set_time(stamp)
                send(readings.read(row))

    def _sensors(self) -> Iterator[tuple[Readings, Callable[[Any], None]]]:
        """Readings of the sensors, and what logs one; the parts of images one by one."""
        run = self.run
        images = {"photo": self._photo, "label": self._label, "depth": self._depth, "normal": self._normal}
        for view in run.of(Image, recorded=False):
            for part, send in (images | {"flow": self._flow}).items():
                if view.has(run.counts, part):
                    yield run.readings(view.name, [part]), send
        for source in run.of(Cloud):
            yield run[source.name], self._points
        for source in run.of(Inertial):
            yield run[source.name], partial(self._inertial, source.name)
        for source in run.of(Fix):
            yield run[source.name], partial(self._fix, source.name)
        for source in run.of(WheelSpeeds):
            yield run[source.name], self._wheels

    def _set_time(self, stamp_ns: int) -> None:
        if stamp_ns < _EPOCH_NS:
            self.recording.set_time(TIMELINE, duration=np.timedelta64(stamp_ns, "ns"))
        else:
            self.recording.set_time(TIMELINE, timestamp=np.datetime64(stamp_ns, "ns"))

    def _entity(self, frame: str) -> str:
        return self._entities.get(frame, f"{BASE}/{frame}")

    def _transform(self, parent_from_child: NDArray[np.float64]) -> Any:
        return self.rr.Transform3D(translation=parent_from_child[:3, 3], mat3x3=parent_from_child[:3, :3])

    def _odometry(self, reading: Message) -> None:
        message = reading.value
        self.recording.log(BASE, self._transform(read.pose_matrix(message.pose.pose)))
        linear = message.twist.twist.linear
        self._scalar("speed", float(np.linalg.norm([linear.x, linear.y, linear.z])))

    def _wheel_frames(self, reading: Message) -> None:
        for each in reading.value.transforms:
            if each.child_frame_id in WHEEL_FRAMES:
                self.recording.log(self._entity(each.child_frame_id), self._transform(read.matrix(each.transform)))

    def _points(self, cloud: Cloud) -> None:
        radii, label = self.rr.Radius.ui_points(1.5), cloud.label.astype(np.uint16)
        entity = f"{self._entity(cloud.frame)}/points"
        self.recording.log(entity, self.rr.Points3D(cloud.xyz, class_ids=label, radii=radii))

    def _lens(self, lens: Lens) -> None:
        if not lens.is_pinhole or not lens.K[0, 0]:  # rerun has pinholes only; other images are shown flat
            return
        matrix = lens.K.copy()
        matrix[:2, 2] += 0.5  # rerun's origin is the corner of the first pixel, that of ROS its centre
        axes, size = self.rr.ViewCoordinates.RDF, {"width": lens.width, "height": lens.height}
        pinhole = self.rr.Pinhole(image_from_camera=matrix, camera_xyz=axes, image_plane_distance=1.0, **size)
        self.recording.log(self._entity(lens.frame), pinhole, static=True)

    def _photo(self, image: Image) -> None:
        entity = f"{self._entity(image.frame)}/photograph"
        shown = self.rr.Image(image.photo) if image.jpeg is None else None
        self.recording.log(entity, shown or self.rr.EncodedImage(contents=image.jpeg, media_type="image/jpeg"))

    def _label(self, image: Image) -> None:
        shown = self.rr.SegmentationImage(image.label, opacity=0.4, draw_order=1.0)
        self.recording.log(f"{self._entity(image.frame)}/tag", shown)

    def _depth(self, image: Any) -> None:
        shown = self.rr.DepthImage(np.where(np.isfinite(image.depth), image.depth, 0.0).astype(np.float32), meter=1.0)
        self.recording.log(f"depth/{image.frame}", shown)

    def _normal(self, image: Any) -> None:
        self.recording.log(f"normals/{image.frame}", self.rr.Image(normal_colours(image.normal)))

    def _flow(self, image: Any) -> None:
        self.recording.log(f"flow/{image.frame}", self.rr.Image(flow_colours(image.flow)))

    def _inertial(self, name: str, reading: Inertial) -> None:
        for what in ("angular_velocity", "linear_acceleration"):
            for axis, value in zip("xyz", getattr(reading, what), strict=True):
                self._scalar(f"{name}/{what}/{axis}", value)

    def _fix(self, name: str, fix: Fix) -> None:
        self.recording.log(f"fixes/{name}", self.rr.GeoPoints(lat_lon=fix.geodetic[:2].tolist()))

    def _wheels(self, wheels: WheelSpeeds) -> None:
        for name, value in zip(wheels.names, wheels.speed, strict=True):
            self._scalar(f"wheels/{name}", value)

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


def _shown(readings: Readings) -> Iterator[tuple[int, int]]:
    """Row and stamp [ns] of the readings that are shown: of images ``RATE`` per second, of others all."""
    last = -_EPOCH_NS
    for row, stamp in enumerate(readings.stamps_ns.tolist()):
        if readings.source.type is not Image or stamp - last >= 0.999e9 / RATE:
            last = stamp
            yield row, stamp


def _blueprint(run: Run) -> Any:
    import rerun.blueprint as rrb

    images = [
        rrb.Spatial2DView(
            origin=f"{BASE}/{view.frame.removesuffix('_optical')}/{view.frame}", name=f"{view.label} camera"
        )
        for view in run.of(Image, recorded=False)
        if view.has(run.counts, "photo") or view.has(run.counts, "label")
    ]
    views = [("speed", "speed [m/s]")]
    inertial = [source.name for source in run.of(Inertial, recorded=False)]
    for name in inertial:
        of = f" of {name}" * (len(inertial) > 1)
        views.append((f"{name}/angular_velocity", f"angular velocity{of} [rad/s]"))
        views.append((f"{name}/linear_acceleration", f"acceleration{of} [m/s²]"))
    views.append(("wheels", "wheels [rad/s]"))
    curves = [rrb.TimeSeriesView(origin=f"curves/{origin}", name=name) for origin, name in views]
    shown = [rrb.Grid(*images)] if len(images) > 2 else images
    right = rrb.Vertical(*shown, rrb.Tabs(*curves)) if images else rrb.Vertical(*curves)
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Spatial3DView(origin="world", name="world"), right, column_shares=[3, 2]),
        rrb.TimePanel(timeline=TIMELINE),
        collapse_panels=True,
    )


def check_display(instead: str) -> None:
    """Raise OutputError, which says what to do instead, if there is no display for a viewer's window."""
    if sys.platform == "linux" and not os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY"}:
        raise OutputError(f"there is no display for the viewer; {instead}")


def end_recording(recording: Any) -> None:
    """Send a viewer what waits. One that was closed before loses it, of which the library has logged a line."""
    with suppress(RuntimeError):
        recording.flush(timeout_sec=5.0)
    recording.disconnect()


def rerun_library() -> Any:
    """Import rerun.

    Raises:
        OutputError: it is not installed.
    """
    try:
        import rerun
    except ImportError as error:
        raise OutputError("the viewer is not installed; run: pip install 'fieldtruth[view]'") from error
    return rerun
