# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The values used last, each made once: what a worker process keeps between tasks."""

from collections.abc import Callable, Hashable
from concurrent.futures import Future
from threading import Lock
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class Recent(Generic[K, V]):
    """The ``size`` values used last. Threads that ask for a value while another one makes it wait for that."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._lock = Lock()
        self._values: dict[K, Future[V]] = {}

    def get(self, key: K, make: Callable[[], V]) -> V:
        """Return the value of a key, which is made if it is not kept; an error of ``make`` is not kept."""
        with self._lock:
            value = self._values.pop(key, None)
            mine = value is None
            value = Future[V]() if value is None else value
            self._values[key] = value  # the last in order is the last used
            for oldest in list(self._values)[: -self._size]:
                del self._values[oldest]
        if mine:
            try:
                value.set_result(make())
            except BaseException as error:
                with self._lock:
                    self._values.pop(key, None)
                value.set_exception(error)
        return value.result()
