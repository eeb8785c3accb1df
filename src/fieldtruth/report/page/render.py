# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Render the content of a page with the templates, style and scripts of this folder into one HTML file.

The page's content security policy forbids every request and every script except ours, whatever names a bag contains.
"""

import base64
import hashlib
from importlib import resources
from typing import Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

import fieldtruth
from fieldtruth.report.drawing.text import fixed
from fieldtruth.report.page.content import PageContent
from fieldtruth.report.page.tables import ROWS

_SCRIPTS: Final = ("page.js", "cloud.js")


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
    environment.filters |= {"base64": _base64, "fixed": fixed}
    return environment.get_template("page.html.jinja").render(
        content=content,
        run=content.run,
        version=fieldtruth.__version__,
        policy=policy,
        max_rows=ROWS,
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
