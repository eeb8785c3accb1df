# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What can go wrong on a cluster, in one line each."""

from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import Any

from distributed import KilledWorker
from distributed.comm import CommClosedError

from fieldtruth.core.errors import ClusterError, SliceError


class OtherWorkerError(ClusterError):
    """The worker at ``address`` would make other slices than the client expects."""

    def __init__(self, address: str) -> None:
        super().__init__(f"worker {address} has other code, libraries or worlds than this machine")
        self.address = address

    def __reduce__(self) -> tuple[Any, ...]:
        """Keep the address in another process."""
        return type(self), (self.address,)


@contextmanager
def cluster_errors() -> Iterator[None]:
    """Turn what Dask raises when it loses scheduler or workers into one clear line.

    Raises:
        ClusterError: what was lost; the same command resumes.
        SliceError: a task ended one worker after the other.
    """
    again = "finished slices are kept, and the same command makes the rest"
    try:
        yield
    except KilledWorker as error:
        workers = f"{error.allowed_failures + 1} workers in turn, the last one {error.last_worker.address}"
        raise SliceError(f"{error.task} ended {workers}; give them more memory; {again}") from error
    except (CancelledError, CommClosedError, TimeoutError) as error:
        raise ClusterError(f"the connection to the scheduler was lost; {again}") from error
    except (ImportError, AttributeError) as error:
        raise ClusterError(f"a worker does not have the fieldtruth of this machine: {error}") from error
