# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""An HTML page about a run: one file that needs no network, no server and no other file."""

import base64
import hashlib
import shlex
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

import fieldtruth
from fieldtruth.bag.file import TRACK
from fieldtruth.bag.run import open_run
from fieldtruth.core.files import output_errors, output_path, write_atomically
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.report.drawing.style import fixed, shortened
from fieldtruth.report.page.content import PageContent, collect_content
from fieldtruth.report.page.tables import ROWS

_SCRIPTS: Final = ("page.js", "cloud.js")
LARGEST_PAGE: Final = 15_000_000
"""Limit [byte] of a page, however long the run: number and size of all parts are bounded."""


def render_page(content: PageContent) -> str:
    """Return the page as HTML."""
    scripts = [_source(name) for name in _SCRIPTS]
    hashes = " ".join(f"'sha256-{_base64(hashlib.sha256(script.encode()).digest())}'" for script in scripts)
    policy = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {hashes}; base-uri 'none'"
    environment = Environment(
        loader=PackageLoader("fieldtruth.report.page", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "base64": _base64,
        "fixed": fixed,
        "shortened": shortened,
        "quote": shlex.quote,
        "ascii": ascii,
    }
    return environment.get_template("page.html.jinja").render(
        content=content,
        run=content.run,
        version=fieldtruth.__version__,
        policy=policy,
        max_rows=ROWS,
        track_file=TRACK,
        style=Markup(_source("style.css")),
        scripts=[Markup(script) for script in scripts],
        numbers={
            "duration": content.run.duration_s * 1e3,
            "curves": content.curve_values,
            "path": content.map.positions if content.map else [],
            "classes": {colour: name for name, colour in content.image_classes},
        },
    )


def _source(name: str) -> str:
    return resources.files("fieldtruth.report.page").joinpath(name).read_text(encoding="utf-8")


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode()


def write_report(
    path: Path | str, *, out: Path | str | None = None, overwrite: bool = False, progress: Progress | None = None
) -> Path:
    """Write an HTML page about a run; by default ``NAME_report.html`` beside the bag.

    It shows the path on an aerial view, stereo pairs with their tag images, an interactive labelled cloud, class
    shares, time series of the other sensors, calibration, topics, checksums and how to load the run (paper, Figures 12
    and 17 to 21). The page states what the bag lacks.

    Args:
        path: folder of a run, or a bag.
        out: an .html file.
        overwrite: replace an existing file.
        progress: receives the stages of the work.

    Returns:
        Path of the page.

    Raises:
        BagError: the bag does not exist or is damaged.
        ConfigurationError: its experiment.yaml cannot be read.
        OutputError: the page already exists, or cannot be written.
    """
    check = partial(output_path, endings=(".html", ".htm"), parents=False, overwrite=overwrite)
    target = None if out is None else check(out)
    run = open_run(path)
    if target is None:
        target = check(run.folder / f"{run.name}_report.html")
    progress = Silent() if progress is None else progress
    content = collect_content(run, cpu_count(), progress)
    with progress.stage("write the page"), output_errors(target):
        write_atomically(target, render_page(content).encode(errors="replace"))
    return target


__all__ = ["LARGEST_PAGE", "write_report"]
