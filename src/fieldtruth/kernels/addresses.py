# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Functions and memory of C libraries in kernels: symbols by name, and addresses as pointers."""

from typing import Any

import numpy as np
from llvmlite import binding as llvm
from numba import types
from numba.extending import intrinsic

from fieldtruth.kernels.compile import inlined


def _pointer_to(kind: Any) -> Any:
    """Return a function that makes an address a pointer; ``numba.carray`` would count references."""

    def make(_context: Any, _address: Any) -> Any:
        def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(kind))

        return kind(types.uint64), generate

    return intrinsic(make)


_pointer: Any = types.CPointer
at = _pointer_to(types.voidptr)
_integers, words_at, singles_at, doubles_at = (
    _pointer_to(_pointer(each)) for each in (types.int32, types.uint64, types.float32, types.float64)
)
"""The last three: arrays of numbers of 64, 32 and 64 bits without a length: ``words_at(address)[k]``."""


@inlined
def integer_at(address: int) -> int:
    """Return the integer of 32 bits at an address."""
    return int(_integers(np.uint64(address))[0])


@inlined
def address_at(address: int) -> int:
    """Return the address at an address."""
    return int(words_at(np.uint64(address))[0])


def external(name: str, arguments: int) -> Any:
    """Return a function of C that takes addresses and returns nothing, for kernels; see ``register``."""
    return types.ExternalFunction(name, types.void(*[types.uint64] * arguments))


def register(name: str, address: int) -> None:
    """Say where a function of ``external`` is, before a kernel that calls it is compiled or loaded."""
    llvm.add_symbol(name, address)
