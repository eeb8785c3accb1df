# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Automatically annotated data sets of a ground robot in natural environments.

All public names are here, flat: ``import fieldtruth as ft`` is enough. They are listed in ``__init__.pyi``; each is
imported when it is first used, so that ``import fieldtruth`` takes milliseconds.
"""

from typing import Any

import lazy_loader

_lazy, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # late: reading the metadata costs more than all the rest

        globals()[name] = version(__name__)
        return globals()[name]
    return _lazy(name)
