# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Templates of texts: a name without a value is an error, and lines of statements alone leave no trace."""

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined


def templates(package: str, folder: str = ".", **options: Any) -> Environment:
    """Return the Jinja templates in a folder of a package; ``options`` are further ones of ``jinja2.Environment``."""
    usual: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    return Environment(loader=PackageLoader(package, folder), undefined=StrictUndefined, **(usual | options))
