# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Episodes of any policy as data for offline learning and imitation: a data set of Minari, or of LeRobot."""

from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.core.files import output_errors, output_path, remove, replace_synced
from fieldtruth.core.progress import Progress
from fieldtruth.learning.driven import Drives

FORMATS: Final = {"minari": ("h5py", "minari", "rl"), "lerobot": ("pyarrow", "pyarrow", "huggingface")}
"""Libraries that each format needs, and the extra that installs them."""


def record_episodes(
    drives: Drives, out: Path, *, to: str = "minari", overwrite: bool = False, progress: Progress | None = None
) -> str:
    """Record episodes of a policy as a data set, and return its id, which is also its folder below ``out``.

    Splits share no world: the id has ``train`` or ``test``, as ``split`` among the environment's arguments says.

    Args:
        drives: the episodes.
        out: a root folder of data sets, such as ``MINARI_DATASETS_PATH``.
        to: one of ``FORMATS``.
        overwrite: replace a data set of this id.
        progress: receives it.

    Raises:
        ConfigurationError: a library is not installed, the policy fails, or a value that is not allowed.
        UnknownNameError: a name that does not exist.
        OutputError: the data set exists, or cannot be written.
    """
    writer = _writer(to)
    name: str = writer.id_of(drives)
    path, env = output_path(out / name, overwrite=overwrite), drives.environment()
    with output_errors(out):
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=out, prefix=".") as root:
            writer.write(drives, env, drives.drive(env, progress), Path(root))
            path.parent.mkdir(parents=True, exist_ok=True)
            remove(path)
            replace_synced(Path(root) / name, path)
    return name


def _writer(to: str) -> Any:
    """Return the module that writes a format; raises UnknownNameError, or ConfigurationError without its libraries."""
    if to not in FORMATS:
        raise UnknownNameError("format", to, FORMATS)
    *libraries, extra = FORMATS[to]
    try:
        for library in libraries:
            import_module(library)
    except ModuleNotFoundError as error:
        text = f"the library {error.name} is not installed; run: pip install 'fieldtruth[{extra}]'"
        raise ConfigurationError(text) from error
    return import_module(f"fieldtruth.learning.{to}_data")
