# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From findings to one HTML file: template, style and scripts lie beside this file and are put into the page.

Nothing on a page comes from elsewhere: its security policy forbids every request, and every script but our own,
whatever a bag's names say.
"""

import base64
import hashlib
from importlib import resources
from typing import Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

import fieldtruth
from fieldtruth.report.page.content import Findings

_SCRIPTS: Final = ("page.js", "cloud.js")


def render(found: Findings) -> str:
    """Return the page."""
    scripts = [_source(name) for name in _SCRIPTS]
    allowed = " ".join(f"'sha256-{_digest(script)}'" for script in scripts)
    policy = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {allowed}; base-uri 'none'"
    environment = Environment(
        loader=PackageLoader("fieldtruth.report.page", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html.jinja").render(
        found=found,
        run=found.run,
        version=fieldtruth.__version__,
        policy=policy,
        style=Markup(_source("style.css")),
        scripts=[Markup(script) for script in scripts],
        numbers={
            "duration": found.run.duration_s * 1e3,
            "curves": found.numbers,
            "way": found.map.way if found.map else [],
            "classes": {colour: name for name, colour in found.look_classes},
        },
    )


def _source(name: str) -> str:
    return resources.files("fieldtruth.report.page").joinpath(name).read_text(encoding="utf-8")


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
