# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Run the command line as on another processor: Embree with another instruction set, Numba with another target.

Run: python other_processor.py generate park_1 ...; without arguments it prints what makes readings in its process.
Embree takes the set in the configuration of its device, which the package asks for when it is imported.
"""

import ctypes
import os
import platform
import sys
from typing import Any, Final

INTEL: Final = platform.machine().lower() in ("x86_64", "amd64")
"""True where Embree has several instruction sets."""
AVX512: Final = ("avx2", "haswell")
"""The other processor, as instruction set and target, where this one has AVX-512: most laptops."""
OTHERS: Final = ("sse4.2", "nehalem")
"""The other processor where this one has not."""


class OtherLibrary(ctypes.CDLL):
    """A library in which a device of Embree gets another instruction set."""

    instruction_set = b""

    def __getattr__(self, name: str) -> Any:
        found: Any = super().__getattr__(name)
        if name == "rtcNewDevice":
            found.restype, found.argtypes = ctypes.c_void_p, (ctypes.c_char_p,)
            new_device = found
            form = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_char_p)
            found = form(lambda settings: new_device((settings or b"") + b",isa=" + self.instruction_set))
            setattr(self, name, found)  # keeps the function alive
        return found


def main() -> int:
    """Become the other processor, and run the command."""
    instruction_set, target = os.environ["OTHER_PROCESSOR"].split()
    OtherLibrary.instruction_set = instruction_set.encode()
    os.environ["NUMBA_CPU_NAME"] = target
    ctypes.CDLL = OtherLibrary  # type: ignore[misc]
    from fieldtruth.bag.provenance import this_process
    from fieldtruth.cli import main as run
    from fieldtruth.render import daylight

    daylight.DOME_TEXELS = int(os.environ.get("SKY_TEXELS", daylight.DOME_TEXELS))  # type: ignore[misc]
    if len(sys.argv) > 1:
        return run(sys.argv[1:])
    print("\n".join(f"{name}: {value}" for name, value in this_process().items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
