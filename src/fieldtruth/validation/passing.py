# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The pass over a bag: messages go to those who asked for their topic, heavy work to threads, in order."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from rosbags.typesys.store import Typestore

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import BagError, RawMessage, open_bag
from fieldtruth.bag.run import EXPERIMENT, Run, find_bag, open_run
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.parallel import cpu_count, in_order
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.validation import bagfile
from fieldtruth.validation.agreement import Agreement
from fieldtruth.validation.bagfile import BagFile
from fieldtruth.validation.calibration import Calibration
from fieldtruth.validation.check import Check
from fieldtruth.validation.clouds import Clouds
from fieldtruth.validation.drive import Drive
from fieldtruth.validation.felt import Gnss, Imu, Wheels
from fieldtruth.validation.files import checksums_check, is_run
from fieldtruth.validation.headers import Headers, topics_check
from fieldtruth.validation.law import Law, check_of
from fieldtruth.validation.objects import ObjectLaw
from fieldtruth.validation.pictures import Pictures
from fieldtruth.validation.rebuild import Objects, rebuilt
from fieldtruth.validation.rescan import Rescan
from fieldtruth.validation.reshoot import Reshoot
from fieldtruth.validation.sampler import Sampler
from fieldtruth.validation.stamps import Stamps
from fieldtruth.validation.states import Clock, States
from fieldtruth.validation.streams import PoseStreams
from fieldtruth.validation.subject import Examiner, Job, Subject, place_of
from fieldtruth.validation.witness import Witness

SAMPLES: Final = 20
"""Moments of a run at which costly checks are made."""

_UNPACKED_BY_HAND: Final = (table.CLOCK, table.MODEL_STATES)
_TELL_NS: Final = 10**8


def validate(
    path: Path,
    *,
    workers: int | None = None,
    progress: Progress | None = None,
    quick: bool = False,
    full: bool = False,
    samples: int = SAMPLES,
) -> list[Check]:
    """Check everything in a run.

    Args:
        path: folder of a run, or a bag.
        workers: threads; None takes every core that the process may use. The result does not depend on it.
        progress: is told how far the work has come.
        quick: build no world, so that nothing is traced again.
        full: trace every image again, and not only a sample.
        samples: about how many moments are sampled.

    Returns:
        The checks, in a fixed order.

    Raises:
        BagError: there is no run at this path.
    """
    workers = cpu_count() if workers is None else workers
    progress = Silent() if progress is None else progress
    bag = find_bag(path)
    checksums = checksums_check(bag, progress)
    try:
        run, experiment = _opened(bag)
    except BagError as error:
        if not is_run(bag):
            raise
        return [checksums, Check(bagfile.NAME, False, str(error))]
    place, why = rebuilt(run, quick=quick, progress=progress)
    subject = Subject(run, place, why)
    with progress.stage("read and check", run.duration_s) as advance:
        checks = _pass(subject, workers, advance, full=full, samples=samples)
    return [checksums, experiment, *checks]


def _opened(bag: Path) -> tuple[Run, Check]:
    """Open a run; an experiment that cannot be read is a failed check and no reason to stop."""
    try:
        run = open_run(bag)
    except ConfigurationError as error:
        with open_bag(bag) as stored:
            counts = {topic: count for topic, count in stored.counts.items() if count}
            bare = Run(bag, None, counts, stored.msgtypes, stored.start_ns, stored.end_ns)
        return bare, Check("experiment", False, str(error))
    if run.experiment is not None:
        return run, Check("experiment", True, f"{EXPERIMENT} says what made the bag: {run.experiment.name}")
    there = (run.folder / EXPERIMENT).exists()
    return run, Check("experiment", None, f"{EXPERIMENT} is another bag's" if there else f"no {EXPERIMENT}")


class _Pass:
    """One reading of the bag."""

    def __init__(self, subject: Subject, examiners: list[Examiner], store: Typestore) -> None:
        self._subject = subject
        self._examiners = examiners
        self._store = store
        self._by_topic: dict[str, list[Examiner]] = {}
        for examiner in examiners:
            for topic in examiner.topics:
                self._by_topic.setdefault(topic, []).append(examiner)
        self.whole = Law("every message holds exactly what its type says")

    def jobs(self, messages: Iterator[RawMessage], advance: Callable[[float], None]) -> Iterator[Job]:
        """Show all messages to the examiners, and hand on the work that they order meanwhile."""
        subject, told_ns = self._subject, self._subject.run.start_ns
        for raw in messages:
            self._show(raw)
            if raw.stamp_ns - told_ns >= _TELL_NS:
                advance((raw.stamp_ns - told_ns) / 1e9)
                told_ns = raw.stamp_ns
            while subject.jobs:
                yield subject.jobs.popleft()
        subject.motion.finish()
        for examiner in self._examiners:
            examiner.finish()
        while subject.jobs:
            yield subject.jobs.popleft()

    def _show(self, raw: RawMessage) -> None:
        try:
            message = None if raw.topic in _UNPACKED_BY_HAND else self._decoded(raw)
            for examiner in self._by_topic.get(raw.topic, ()):
                examiner.feed(raw, message)
        except BagError as error:
            self.whole.see(False, f"{place_of(raw)}: {error}")
        else:
            self.whole.see(True, "")

    def _decoded(self, raw: RawMessage) -> Any:
        try:
            return self._store.deserialize_ros1(raw.data, raw.msgtype)
        except Exception as error:  # the generated code raises whatever the bytes lead it to
            raise BagError(str(error) or type(error).__name__) from error


def _pass(subject: Subject, workers: int, advance: Callable[[float], None], *, full: bool, samples: int) -> list[Check]:
    objects = ObjectLaw(subject)
    # The true motion comes first: others ask for it.
    plain: list[Examiner] = [Stamps(subject), Headers(subject), Calibration(subject), States(subject), Clock(subject)]
    plain += [Objects(subject), Drive(subject), PoseStreams(subject), Imu(subject), Gnss(subject), Wheels(subject)]
    plain += [Clouds(subject, objects), Pictures(subject, objects)]
    again, last = _measuring_again(subject, full=full, samples=samples)
    file = BagFile(subject.run.bag)
    with open_bag(subject.run.bag) as stored:
        store = stored.types()
        reading = _Pass(subject, [*plain, *again], store)
        jobs = reading.jobs(file.messages(workers), advance)
        for fold, result in in_order(jobs, lambda job: (job.fold, job.work()), workers):
            fold(result)
        # The MD5 sum of each topic's type, as the bag states it, and as it follows from the definition there.
        digests = {c.topic: (c.digest, store.generate_msgdef(c.msgtype)[1]) for c in stored.connections}
        topics = topics_check(subject, digests)
    figures = f"{reading.whole.seen:,} messages hold what their types say"
    checks = [file.result(), check_of("messages", [reading.whole], figures, "there is none"), topics]
    checks += [check for examiner in plain for check in examiner.results()]
    checks += [objects.result(), *(check for examiner in again for check in examiner.results()), *last()]
    if file.whole:
        return checks
    cut = "the bag cannot be read to its end"
    return [c if c.passed is False else Check(c.name, None, cut) for c in checks]


def _measuring_again(subject: Subject, *, full: bool, samples: int) -> tuple[list[Examiner], Callable[[], list[Check]]]:
    """Examiners that compare measurements with each other and with the rebuilt world; and the checks that come last."""
    run = subject.run
    pairs, clouds, moments = (Sampler(run.start_ns, run.end_ns, samples) for _ in range(3))
    agreement = Agreement(subject, pairs)
    if subject.place is None:
        names = ("retraced clouds", "retraced images", "photographs", "independent rays")
        return [agreement], lambda: [Check(name, None, subject.no_place) for name in names]
    witness = Witness(subject, subject.place)
    rescan = Rescan(subject, subject.place, witness, clouds)
    reshoot = Reshoot(subject, subject.place, witness, moments, full=full)
    return [agreement, rescan, reshoot], lambda: [witness.result()]
