# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A whole campaign: check, draw, estimate, make what is left, and say what became of it."""

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from pathlib import Path
from typing import NamedTuple

from fieldtruth.campaign.config import Campaign
from fieldtruth.campaign.draw import PlannedRun, Shard, draw
from fieldtruth.campaign.estimate import check_resources, estimate, free_bytes
from fieldtruth.campaign.files import check_campaign, check_folder, load_campaign, write_campaign
from fieldtruth.campaign.jobs import STOPPING, Generate, Outcome, make_runs, run_one
from fieldtruth.campaign.state import Failure, Kind, Manifest, State, clock, counts, size, state_of, time_left_s
from fieldtruth.core.errors import warnings_in_one_line
from fieldtruth.core.files import output_folder
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Advance, Progress, Silent
from fieldtruth.record.folder import new_folder

Shows = Callable[[], AbstractContextManager[Progress]]
"""Opens a display of progress, as ``fieldtruth.show_progress`` does."""
Say = Callable[[str], None]
"""Receives lines for the user."""


def silent() -> AbstractContextManager[Progress]:
    """Show nothing."""
    return nullcontext(Silent())


@contextmanager
def run_bar(shows: Shows, name: str) -> Iterator[Progress]:
    """Show the stages of a run that count simulated time, each as a bar with the name of the run."""
    with shows() as progress:
        yield _Named(progress, name)


class _Named:
    def __init__(self, progress: Progress, name: str) -> None:
        self._progress = progress
        self._name = name

    @contextmanager
    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> Iterator[Advance]:
        inner = Silent() if total is None else self._progress
        with inner.stage(f"{self._name}: {name}", total, done) as advance:
            yield advance


class Options(NamedTuple):
    """Options of making a campaign, on which the bytes do not depend."""

    jobs: int = 1
    workers: int | None = None
    """Threads of each job; None shares the cores."""
    shard: Shard = Shard(1, 1)
    overwrite: bool = False
    """Replace another campaign and finished runs."""
    measure: bool = True
    """Estimate time, bytes and memory first."""
    generate: Generate | None = None
    """Makes a run elsewhere, in place of ``fieldtruth.generate``; jobs are then threads of this process."""


def run_campaign(
    campaign: Campaign | Path | str,
    out: Path | str,
    *,
    jobs: int = 1,
    workers: int | None = None,
    shard: tuple[int, int] = (1, 1),
    overwrite: bool = False,
) -> list[State]:
    """Make the runs of a campaign that are left in a folder, and return the state of each.

    Runs that fail do not stop the others, and a campaign that was interrupted goes on when it is called again.

    Args:
        campaign: a campaign, its file, or ``all`` for every built-in experiment.
        out: folder of the campaign; each run is a folder in it.
        jobs: runs side by side, each in a process; with more than one the calling script needs
            ``if __name__ == "__main__":``.
        workers: threads of each job; None shares the cores. The bytes do not depend on it.
        shard: which part, from 1, of how many parts.
        overwrite: replace another campaign and finished runs.

    Raises:
        ConfigurationError: a value that is not allowed.
        OutputError: the folder holds another campaign, or cannot be written.
    """
    chosen = campaign if isinstance(campaign, Campaign) else load_campaign(campaign)
    source = "" if isinstance(campaign, Campaign) else str(campaign)
    check_campaign(chosen, source)
    options = Options(jobs, workers, Shard(*shard), overwrite, measure=False)
    return generate_campaign(chosen, output_folder(out), options, source=source, say=lambda line: None)


def generate_campaign(
    campaign: Campaign, out: Path, options: Options, *, source: str = "", shows: Shows = silent, say: Say = print
) -> list[State]:
    """Make the runs of a campaign that are left in OUT, or those of a shard, and return the state of each.

    Runs that fail do not stop the others. Runs that other processes are making are left to them. ``source``,
    the campaign's file for example, is put in front of errors of the configuration. ``shows`` displays the progress of
    measurements, and of runs that are made one after the other.

    Raises:
        ConfigurationError: a drawn value that is not allowed, too many runs, or a split without a world.
        OutputError: the folder holds another campaign, cannot be written, or disk or memory cannot hold the runs.
        KeyboardInterrupt: finished runs and slices are kept.
    """
    output_folder(out)
    everything = draw(campaign, source)
    if not options.overwrite:
        check_folder(campaign, everything, out)
    runs = options.shard.of(everything)
    states = [state_of(run, out) for run in runs]
    left = runs if options.overwrite else [state.run for state in states if state.is_left]
    say(f"{out}: {counts(states)}")
    workers = max(1, cpu_count() // options.jobs) if options.workers is None else options.workers
    with new_folder(out):
        if left and options.measure:
            _announce(left, out, options.jobs, workers, shows, say)
        write_campaign(campaign, out)
        if left:
            done = [] if options.overwrite else [state for state in states if state.kind is Kind.DONE]
            _make(done, left, out, options, workers, shows, say)
            states = [state_of(run, out) for run in runs]
            say(f"{out}: {counts(states)}")
    return states


def _announce(left: list[PlannedRun], out: Path, jobs: int, workers: int, shows: Shows, say: Say) -> None:
    with shows() as progress:
        expected = estimate(left, out, jobs=jobs, workers=workers, progress=progress)
    but = f"; {expected.unknown} runs could not be measured" if expected.unknown else ""
    say(
        f"{len(left)} runs: about {clock(expected.time_s)} with {jobs} x {workers} workers, "
        f"{size(expected.bytes)} of {size(free_bytes(out))} free, {size(expected.memory)} of memory{but}"
    )
    check_resources(expected, out)


def _make(
    done: list[State], left: list[PlannedRun], out: Path, options: Options, workers: int, shows: Shows, say: Say
) -> None:
    if options.jobs == 1:
        ended = _one_by_one(left, out, options, workers, shows)
    elif options.generate is not None:
        ended = _in_threads(left, out, options, workers)
    else:
        ended = make_runs(left, out, jobs=options.jobs, workers=workers, overwrite=options.overwrite)
    with closing(ended):
        waiting = {run.name: State(run, Kind.MISSING) for run in left}
        for k, (run, outcome) in enumerate(ended, 1):
            del waiting[run.name]
            if isinstance(outcome, Manifest):
                done.append(State(run, Kind.DONE, manifest=outcome))
            left_s = time_left_s([*done, *waiting.values()], options.jobs)
            more = f"; about {clock(left_s)} left" if left_s else ""
            say(f"{k} of {len(left)}: {_line(run, outcome, out)}{more}")


def _one_by_one(
    left: Sequence[PlannedRun], out: Path, options: Options, workers: int, shows: Shows
) -> Generator[tuple[PlannedRun, Outcome], None, None]:
    for run in left:
        with run_bar(shows, run.name) as progress, warnings_in_one_line(run.name):
            outcome = _outcome(run, out, options, workers, progress)
        yield run, outcome


def _in_threads(
    left: Sequence[PlannedRun], out: Path, options: Options, workers: int
) -> Generator[tuple[PlannedRun, Outcome], None, None]:
    """Make runs side by side where threads only wait, because ``options.generate`` has them made elsewhere."""
    pool = ThreadPoolExecutor(options.jobs, thread_name_prefix="run")
    try:
        waiting = {pool.submit(_outcome, run, out, options, workers, Silent()): run for run in left}
        for ended in as_completed(waiting):
            yield waiting[ended], ended.result()
    finally:  # runs that still wait end when the connection to the cluster does
        pool.shutdown(wait=False, cancel_futures=True)


def _outcome(run: PlannedRun, out: Path, options: Options, workers: int, progress: Progress) -> Outcome:
    generate = {} if options.generate is None else {"generate": options.generate}
    try:
        return run_one(run, out, workers=workers, overwrite=options.overwrite, progress=progress, **generate)
    except STOPPING as error:
        return error


def _line(run: PlannedRun, outcome: Outcome, out: Path) -> str:
    """Say how a run ended.

    Raises:
        FieldtruthError: an error that the others would meet, too, such as a full disk.
    """
    if isinstance(outcome, Manifest):
        return f"{run.name}: {size(outcome.bytes)} in {clock(outcome.took_s)}"
    if isinstance(outcome, Failure):
        return f"{run.name} failed: {outcome.reason}"
    if state_of(run, out).kind in (Kind.RUNNING, Kind.DONE):
        return f"{run.name} is made by another process"
    raise outcome
