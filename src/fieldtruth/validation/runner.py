# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The single pass over a bag: messages go to the checks of their topic, costly work goes to threads, in order.

Sensors whose kind has no check of its own are sensed again in the rebuilt world.
"""

import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from rosbags.typesys.store import Typestore

from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError, find_bag, is_ros1
from fieldtruth.bag.provenance import difference, makers_of
from fieldtruth.bag.reader import BagReader, RawMessage, open_bag
from fieldtruth.core.parallel import cpu_count, in_order
from fieldtruth.core.progress import Advance, Progress, Silent, timed
from fieldtruth.drive.track import Motion, Track
from fieldtruth.experiment.sensor_config import Output
from fieldtruth.sensors.checks import CHECKS
from fieldtruth.sensors.kind import At, Sensor, SensorWorld, movement_of, stamps_of
from fieldtruth.sensors.known import OWN, sensor_class
from fieldtruth.validation import actors, files, motion, movers, streams, world
from fieldtruth.validation.check import Check, Rule, Spec, Tally
from fieldtruth.validation.context import Checker, Context, at
from fieldtruth.validation.files import BagFile, OtherFile
from fieldtruth.validation.kind_checks import Pass
from fieldtruth.validation.rays import INDEPENDENT_RAYS, RayReference

SAMPLES: Final = 20
"""Number of stamps of a run at which costly checks are made."""
DECODABLE: Final = Rule("every message has exactly the bytes of its type")
MESSAGES: Final[Spec] = Spec("messages", (DECODABLE,), "messages")

SAME_READING: Final = Rule("a sensor reads the same again")
OTHER_SENSORS: Final[Spec] = Spec("other sensors", (SAME_READING,), "readings")
_OPEN: Final = 500
"""Readings for which further messages are awaited."""
_BEFORE_NS: Final = 10**9
"""Motion [ns] before a reading that is kept for it."""

CALIBRATION: Final[Spec] = Spec(
    "calibration",
    (*motion.MOUNT_RULES, *(rule for kind in CHECKS for rule in kind.calibration)),
    "items",
    "neither /tf_static nor CameraInfo",
)

SPECS: Final[tuple[Spec, ...]] = (
    files.CHECKSUMS_SPEC, files.EXPERIMENT_SPEC, files.STRUCTURE, MESSAGES,
    streams.TOPICS, streams.COUNTS, streams.STAMPS, streams.SYNCHRONISATION, streams.CLOCK, streams.HEADERS,
    streams.FRAMES, CALIBRATION, motion.STATIC_OBJECTS, motion.MOTION, motion.POSES, motion.DRIVE,
    *(spec for kind in CHECKS for spec in kind.motion), motion.COMMANDS,
    *(spec for kind in CHECKS for spec in kind.form), world.OBJECT_CLASSES,
    *(spec for kind in CHECKS for spec in kind.between), world.WORLD,
    *(spec for kind in CHECKS for spec in kind.retraced), INDEPENDENT_RAYS,
)  # fmt: skip
"""All checks, in the order of the output."""
_NOT_IDEAL: Final = (streams.CLOCKS, *(spec for kind in CHECKS for spec in kind.signal))
"""Checks of a run with sensors that are not ideal."""
ALL_SPECS: Final = (
    *SPECS,
    movers.MOVING_OBJECTS,
    actors.ACTORS,
    *_NOT_IDEAL,
    *(spec for kind in CHECKS for spec in kind.extras),
)
"""All checks, those of runs with sensors that are not ideal, and of what some runs only have, included."""
_DECODED_BY_HAND: Final = (table.CLOCK, table.MODEL_STATES, table.STATIC_MODEL_STATES)


def validate(
    path: Path | str,
    *,
    workers: int | None = None,
    progress: Progress | None = None,
    quick: bool = False,
    full: bool = False,
    samples: int = SAMPLES,
) -> list[Check]:
    """Check a run.

    Args:
        path: folder of a run, or a bag.
        workers: number of threads; None uses all cores. The result does not depend on it.
        progress: receives the progress.
        quick: do not rebuild the world, so that nothing is retraced.
        full: retrace every image, not a sample, and render photographs again.
        samples: approximate number of sampled stamps.

    Returns:
        The checks in a fixed order, the skipped ones included.

    Raises:
        BagError: there is no run at this path.
    """
    progress = Silent() if progress is None else progress
    bag = find_bag(path)
    checksums = files.check_checksums(bag, progress)
    try:
        run, experiment = files.open_checked(bag)
    except BagError as error:
        if not files.was_bag(bag):
            raise
        return [checksums, Check(files.STRUCTURE.name, False, str(error))]
    context = Context(run, *world.rebuild(run, quick=quick, progress=progress))
    context.made_elsewhere = difference(makers_of(run.folder))
    with progress.stage("read and check", run.duration_s) as advance, open_bag(bag) as stored:
        checks = _read(context, stored, workers or cpu_count(), advance, _checkers(context, full, samples))
    found = {check.name: check for check in [checksums, experiment, *checks]}
    real = not all(sensor.is_ideal for sensor in context.rig.sensors)
    specs = (
        *SPECS,
        *[movers.MOVING_OBJECTS] * bool(context.movers),
        *[actors.ACTORS] * bool(context.actors),
        *_NOT_IDEAL * real,
        *(spec for kind in CHECKS for spec in kind.extras_of(context)),
        *[OTHER_SENSORS] * _has_other_sensors(context),
    )
    return [found.get(spec.name, Check(spec.name, None, context.no_world)) for spec in specs]


def _checkers(context: Context, full: bool, samples: int) -> list[Checker]:
    """All checks of messages."""
    rays = None if context.rebuilt is None else RayReference(context, context.rebuilt)
    calibration = context.tally(CALIBRATION)
    points = [each for kind in CHECKS for each in kind.points(context.rig)]
    shared = Pass(context, world.ObjectClasses(context), calibration, points, rays, full, samples)
    # The true motion comes first: other checkers compare with it. What moves beside the robot is known before, so that
    # it is complete when the motion says that a reading is over. The second ray tracer gets what the others choose.
    checkers: list[Checker] = [
        streams.Stamps(context), streams.Headers(context), motion.Mounts(context, calibration),
        movers.MovingObjects(context, points), motion.ModelStates(context), motion.Poses(context),
        actors.ActorMotion(context), motion.Drive(context), world.WorldObjects(context),
        *(checker for kind in CHECKS for checker in kind.make(shared)), motion.Commands(context),
        streams.Clocks(context), shared.objects,
    ]  # fmt: skip
    if context.rebuilt is not None and rays is not None:
        checkers += [Readings(context, context.rebuilt), rays]
    return checkers


def _read(context: Context, stored: BagReader, workers: int, advance: Advance, checkers: list[Checker]) -> list[Check]:
    """Read the bag once, and return all checks of its content."""
    file = BagFile(stored.path, stored.connections) if is_ros1(stored.path) else OtherFile(stored)
    store, messages = stored.types(), context.tally(MESSAGES)
    by_topic: dict[str, list[Checker]] = {}
    for checker in checkers:
        for topic in checker.topics:
            by_topic.setdefault(topic, []).append(checker)

    def jobs() -> Iterator[Callable[[], Sequence[Tally]]]:
        for raw in timed(file.messages(), advance, context.run.start_ns):
            try:
                message = None if raw.topic in _DECODED_BY_HAND else _decoded(store, raw)
                for checker in by_topic.get(raw.topic, ()):
                    checker.see(raw, message)
                messages[DECODABLE].see(True, "")
            except BagError as error:
                messages[DECODABLE].see(False, f"{at(raw)}: {error}")
            while context.jobs:
                yield context.jobs.popleft()
        context.motion.finish()
        for checker in checkers:
            checker.finish()
        while context.jobs:
            yield context.jobs.popleft()

    for parts in in_order(jobs(), lambda job: job(), workers):
        for part in parts:
            part.join()
    digests = {c.topic: (c.digest, store.generate_msgdef(c.msgtype)[1]) for c in stored.connections}
    checks = [file.result(), messages.result(), streams.check_topics(context, digests)]
    checks += [tally.result() for checker in checkers for tally in checker.tallies]
    if file.readable:
        return checks
    return [c if c.passed is False else Check(c.name, None, "the bag cannot be read to its end") for c in checks]


def _decoded(store: Typestore, raw: RawMessage) -> Any:
    try:
        return store.deserialize_ros1(raw.data, raw.msgtype)
    except Exception as error:  # the generated code raises arbitrary errors for damaged bytes
        raise BagError(str(error) or type(error).__name__) from error


def _has_other_sensors(context: Context) -> bool:
    """Return whether a rig has sensors whose kind has no check of its own."""
    return any(sensor_class(config) not in OWN for config in context.rig.in_order())


class Readings(Checker):
    """Every reading of kinds without a check, sensed again from the true motion and compared by ``difference``."""

    def __init__(self, context: Context, rebuilt: SensorWorld) -> None:
        self._context, self._tally = context, context.tally(OTHER_SENSORS)
        self._sensor_world, self.tallies, rig = rebuilt, [self._tally], context.rig
        self._configs = {config.name: config for config in rig.in_order() if sensor_class(config) not in OWN}
        outputs = [(config, each) for config in self._configs.values() for each in config.outputs_on(rig.robot)]
        self._of_topic = {topic.name: found for found in outputs for topic in found[1].topics}
        self.topics = tuple(self._of_topic)
        self._open: dict[tuple[str, int], dict[str, Any]] = {}
        """Messages of a reading that has not come as a whole: by output and stamp, then by topic."""
        self._own = threading.local()

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        config, output = self._of_topic[raw.topic]
        reading = self._open.setdefault((output.name, raw.stamp_ns), {})
        reading[raw.topic] = message
        if len(self._open) > _OPEN:  # a topic lacks messages, which the check of counts reports
            del self._open[next(iter(self._open))]
        topics = [topic.name for topic in output.topics]
        if reading.keys() == set(topics) and config.sees:  # what a sensor of motion measures may need the whole drive
            del self._open[output.name, raw.stamp_ns]
            messages = [reading[topic] for topic in topics]
            end_ns = raw.stamp_ns + round(1e9 * config.late_s)
            self._context.motion.when_known(end_ns, lambda: self._submit(raw, output, messages))

    def _submit(self, raw: RawMessage, output: Output, messages: list[Any]) -> None:
        motion = self._context.motion.motion
        since = int(np.searchsorted(motion.stamps_ns, raw.stamp_ns - _BEFORE_NS))
        known = Motion(**{name: rows[since:].copy() for name, rows in vars(motion).items()})
        self._context.jobs.append(lambda: self._compare(raw, output, known, messages))

    def _compare(self, raw: RawMessage, output: Output, motion: Motion, messages: list[Any]) -> list[Tally]:
        sensors: dict[str, Sensor] = vars(self._own)
        config = self._of_topic[raw.topic][0]
        if config.name not in sensors:
            sensors[config.name] = sensor_class(config)(config, self._sensor_world)
        sensor, movement = sensors[config.name], movement_of(Track(motion=motion, swept=motion, base=None))
        number = len(stamps_of(config, output, raw.stamp_ns)) - 1
        reading = sensor.read(output, At(number, raw.stamp_ns, raw.stamp_ns, movement))
        difference = sensor.difference(output, reading, messages)
        part = self._tally.part()
        part[SAME_READING].see(not difference, f"{at(raw)}: {difference}")
        return [part]
