# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The files of a run: their checksums, and the experiment that says what made the bag."""

from pathlib import Path
from typing import Final

from fieldtruth.bag.checksums import CHECKSUMS, read_checksums, sha256_of
from fieldtruth.bag.run import EXPERIMENT
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.progress import Progress
from fieldtruth.validation.check import Check
from fieldtruth.validation.records import MAGIC

NAME: Final = "checksums"


def checksums_check(bag: Path, progress: Progress) -> Check:
    """Files beside a bag against SHA256SUMS there."""
    folder = bag.parent
    try:
        told = read_checksums(folder)
    except (FieldtruthError, OSError) as error:
        return Check(NAME, False, str(error))
    if not told:
        return Check(NAME, None, f"no {CHECKSUMS} beside the bag")
    if bag.name not in told:
        return Check(NAME, None, f"{CHECKSUMS} beside the bag does not name it")
    wrong, size = [], 0
    with progress.stage("checksums"):
        for name, digest in told.items():
            path = folder / name
            if not path.is_file():
                wrong.append(f"{name} is missing")
                continue
            try:
                real = sha256_of(path)
            except OSError as error:
                wrong.append(f"{name} cannot be read: {error.strerror}")
                continue
            size += path.stat().st_size
            if real != digest:
                wrong.append(f"{name} is not what it was: {real[:12]}..., {CHECKSUMS} says {digest[:12]}...")
    if wrong:
        return Check(NAME, False, "; ".join(wrong))
    return Check(NAME, True, f"{len(told)} files, {size / 1e6:.1f} MB, are what {CHECKSUMS} says")


def is_run(bag: Path) -> bool:
    """Whether a file that cannot be read was a bag once: it begins like one, or a run's files beside it say so."""
    try:
        with bag.open("rb") as source:
            begins = source.read(len(MAGIC)) == MAGIC
        return begins or bag.name in read_checksums(bag.parent) or (bag.parent / EXPERIMENT).is_file()
    except (FieldtruthError, OSError):
        return False
