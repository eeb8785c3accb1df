# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One HTML page that shows a run: it needs no network, no server and no other file."""

import os
from pathlib import Path
from typing import Final

from fieldtruth.bag.run import open_run
from fieldtruth.core.errors import OutputError
from fieldtruth.core.files import output_errors
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent

LARGEST_PAGE: Final = 15_000_000
"""A page is smaller than this [byte], however long the run: the number and size of all that it shows are bounded."""
_ENDINGS: Final = (".html", ".htm")


def write_report(
    path: Path, *, out: Path | None = None, overwrite: bool = False, progress: Progress | None = None
) -> Path:
    """Write the page of a run; by default ``NAME_report.html`` beside the bag.

    It shows what was driven, the way on a photograph of the place from above, stereo pairs with their tags, a labelled
    cloud that can be turned, class shares, curves of all small sensors, calibration, topics, checksums and how to load
    the run (paper, Figures 12 and 17 to 21). What a bag lacks, the page lacks, and says so.

    Args:
        path: folder of a run, or a bag.
        out: an .html file.
        overwrite: replace the file if it is there.
        progress: is told how far the work has come.

    Returns:
        Path of the page.

    Raises:
        BagError: no bag there, or a damaged one.
        ConfigurationError: its experiment.yaml cannot be read.
        OutputError: the page is there already, or cannot be written.
    """
    run = open_run(path)
    target = run.folder / f"{run.name}_report.html" if out is None else out
    _check(target, overwrite)
    from fieldtruth.report.page.content import gather
    from fieldtruth.report.page.render import render

    progress = Silent() if progress is None else progress
    found = gather(run, cpu_count(), progress)
    with progress.stage("write the page"):
        page = render(found).encode(errors="replace")
        part = target.with_name(f".{target.name}.part")
        with output_errors(target):
            try:
                part.write_bytes(page)
                part.replace(target)
            finally:
                part.unlink(missing_ok=True)
    return target


def _check(target: Path, overwrite: bool) -> None:
    if target.suffix.lower() not in _ENDINGS:
        raise OutputError(f"cannot write {target}: its name must end in {' or '.join(_ENDINGS)}")
    if target.is_dir():
        raise OutputError(f"{target} is a folder; needed is the name of an .html file")
    if os.path.lexists(target) and not overwrite:
        raise OutputError(f"{target} is there already; choose another --out, or --overwrite replaces it")
    if not target.parent.is_dir():
        raise OutputError(f"cannot write {target}: there is no folder {target.parent}")


__all__ = ["LARGEST_PAGE", "write_report"]
