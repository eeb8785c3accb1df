# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Text files of the package from templates, which hold no number of their own."""

import math
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment
from markupsafe import Markup, escape

from fieldtruth.core.files import write_atomically
from fieldtruth.core.templates import templates


def render(folder: str, template: str, **values: Any) -> str:
    """Return the text of a template in a folder of ``templates``; XML is escaped.

    Templates have the filters ``number`` for one number and ``numbers`` for a list of them, both without loss.
    """
    text = _templates(folder).get_template(template).render(**values)
    return re.sub(r"\n\s*\n", "\n", text) if _is_xml(template) else text


@cache
def _templates(folder: str) -> Environment:
    """Templates of a folder, each compiled once: a package has hundreds of files."""
    environment = templates("fieldtruth.gazebo", f"templates/{folder}", autoescape=_is_xml)
    environment.filters |= {"number": number, "numbers": numbers, "radians": math.radians, "indent": _indented}
    return environment


def _indented(text: str, width: int) -> Markup:
    """Shift all lines but the first; Jinja's own filter escapes each line again, which takes most of a package's time.

    Lines without text get spaces, too; ``render`` removes such lines.
    """
    return Markup(str.replace(escape(text), "\n", "\n" + " " * width))


def write(path: Path, text: str) -> None:
    """Write a text file, its folder included."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, text)


def number(value: float) -> str:
    """Shortest decimal text of a number that reads back as the same number; 0 for -0."""
    text = repr(float(value) + 0.0)
    return text.removesuffix(".0")


def numbers(values: Iterable[float]) -> str:
    """Return numbers with a space between them, as SDF and URDF write vectors."""
    return " ".join(number(value) for value in values)


def _is_xml(template: str | None) -> bool:
    return template is not None and template.endswith((".xml.jinja", ".urdf.jinja", ".sdf.jinja", ".launch.jinja"))
