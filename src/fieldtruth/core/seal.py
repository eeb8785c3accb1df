# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Seals: a digest of content and name at the end of a file, which show damage, and a file under a wrong name.

The digest is BLAKE2b, which reads some 1.3 GB/s on one core.
"""

import hashlib
from pathlib import Path
from typing import BinaryIO, Final

SEAL_SIZE: Final = 32  # [byte]
_BLOCK: Final = 2**20  # [byte]


def add_seal(file: BinaryIO, name: str) -> None:
    """Seal an open file, readable and writable, at its end; ``name`` says what it holds: a key of its inputs."""
    file.seek(0)
    digest = hashlib.blake2b(name.encode() + b"\0", digest_size=SEAL_SIZE)
    while block := file.read(_BLOCK):
        digest.update(block)
    file.write(digest.digest())


def is_sealed(path: Path, name: str) -> bool:
    """Return whether a file is as it was sealed under this name; False, too, if it is missing or cannot be read."""
    digest = hashlib.blake2b(name.encode() + b"\0", digest_size=SEAL_SIZE)
    try:
        with path.open("rb") as file:
            left = path.stat().st_size - SEAL_SIZE
            while left > 0 and (block := file.read(min(left, _BLOCK))):
                digest.update(block)
                left -= len(block)
            return left == 0 and file.read() == digest.digest()
    except OSError:
        return False
