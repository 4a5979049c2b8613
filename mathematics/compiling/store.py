"""The cache of machine code in the user's cache folder: one file for each kernel and its types.

Files are written under another name and renamed, so two processes that compile the same kernel at
once both succeed. A file that is damaged is not used, and is written again.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from contextlib import suppress
from pathlib import Path

_DIGEST = 16


def cache_folder() -> Path:
    """Return the cache folder of machine code: ``aloft/kernels`` in the user's cache folder."""
    root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(root) / "aloft" / "kernels"


def load(name: str) -> bytes | None:
    """Load the machine code called ``name``; ``None`` where there is none or it is damaged."""
    try:
        content = _place(name).read_bytes()
    except OSError:
        return None
    return unsealed(content)


def holds(name: str) -> bool:
    """Return whether there is a file for the machine code called ``name``."""
    return _place(name).is_file()


def save(name: str, code: bytes) -> None:
    """Keep machine code; where the folder cannot be written it is simply not kept."""
    place = _place(name)
    with suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=place.parent, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(sealed(code))
            os.replace(temporary, place)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise


def _place(name: str) -> Path:
    return cache_folder() / name[:2] / f"{name[2:]}.o"


def sealed(code: bytes) -> bytes:
    """Machine code behind its checksum."""
    return _checksum(code) + code


def unsealed(content: bytes) -> bytes | None:
    """Return the machine code behind its checksum, or ``None`` where that does not fit."""
    checksum, code = content[:_DIGEST], content[_DIGEST:]
    return code if _checksum(code) == checksum else None


def _checksum(code: bytes) -> bytes:
    return hashlib.blake2b(code, digest_size=_DIGEST).digest()
