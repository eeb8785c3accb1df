# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The processor as this process uses it, on which the last digit of a reading depends.

Embree orders triangles otherwise in packets of another width, so that a ray may meet either of two surfaces at one
depth; its instruction sets, the code that Numba compiles and the loops of NumPy round otherwise.
"""

from functools import cache
from typing import Final

from numpy.lib.introspect import opt_func_info

from fieldtruth.kernels.compile import compiler_target
from fieldtruth.kernels.packets import LANES
from fieldtruth.sense.embree import native_packet

_SETS: Final = {16: "AVX-512", 8: "AVX or AVX2", 4: "SSE or NEON"}
"""Instruction sets by the widest packet that Embree traces natively with them."""


@cache
def processor() -> dict[str, str]:
    """Return what Embree, Numba and NumPy use in this process: platform, packets, instruction sets, compiler target."""
    triple, name, features = compiler_target()
    loops = opt_func_info(func_name="^exp$", signature="^float64$").get("exp", {})
    return {
        "platform": triple,
        "packet width": str(LANES),
        "Embree's instruction set": _SETS.get(native_packet(), "unknown"),
        "Numba's processor": name,
        "Numba's instruction sets": " ".join(sorted(f[1:] for f in features.split(",") if f.startswith("+"))),
        "NumPy's instruction set": " ".join(sorted({found["current"] for found in loops.values()})),
    }
