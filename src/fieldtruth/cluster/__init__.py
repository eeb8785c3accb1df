# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs on several machines or processes, by Dask (pip install 'fieldtruth[cluster]').

World, drive and slices are made by the workers of a Dask scheduler; this process joins the slices. The bytes are those
of a run in one process. Dask is imported only here, and only when a cluster is asked for.
"""

import json
import logging
import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldtruth.core.errors import ClusterError

if TYPE_CHECKING:
    from distributed import Client

    from fieldtruth.cluster.engine import ClusterEngine

_PATIENCE_S: Final = 10
_ADDRESS: Final = re.compile(r"\w+://.+|[\w.-]+:\d+")


@contextmanager
def cluster_engine(scheduler: str | Path | None = None, processes: int | None = None) -> Iterator["ClusterEngine"]:
    """Connect to a scheduler, or start one with workers on this machine, and yield the engine for ``generate``.

    Args:
        scheduler: address such as ``tcp://host:8786``, or the file that ``dask scheduler --scheduler-file`` wrote.
        processes: start as many workers on this machine instead, with one thread each.

    Raises:
        ClusterError: Dask is not installed, the scheduler does not answer, or its file cannot be read.
    """
    if (scheduler is None) == (processes is None):
        raise ClusterError("give either a scheduler or a number of processes of a local cluster")
    try:
        from fieldtruth.cluster.engine import ClusterEngine
    except ImportError as error:
        raise ClusterError("Dask is not installed; run: pip install 'fieldtruth[cluster]'") from error
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # its lines would repeat ours
    with ExitStack() as stack:
        if processes is not None:
            client = stack.enter_context(_local(processes))
        else:
            client = stack.enter_context(_connected(_address(str(scheduler))))
        yield ClusterEngine(client)


def _address(scheduler: str) -> str:
    path = Path(scheduler)
    if not path.is_file():
        if _ADDRESS.fullmatch(scheduler):
            return scheduler
        raise ClusterError(f"no scheduler file {scheduler}, and an address has the form tcp://host:8786")
    try:
        return str(json.loads(path.read_text(encoding="utf-8"))["address"])
    except (OSError, ValueError, KeyError, TypeError):
        raise ClusterError(f"{path} is not a file that `dask scheduler --scheduler-file` wrote") from None


def _connected(address: str) -> "Client":
    from distributed import Client

    try:
        return Client(address, timeout=_PATIENCE_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(f"no scheduler answers at {address}; start one with `dask scheduler`") from error


@contextmanager
def _local(processes: int) -> Iterator["Client"]:
    from distributed import Client, LocalCluster

    # Without a limit of memory, beyond which Dask would end workers again and again.
    with (
        LocalCluster(
            n_workers=processes, threads_per_worker=1, memory_limit=0, dashboard_address=None, silence_logs=50
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


__all__ = ["cluster_engine"]
