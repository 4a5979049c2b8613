"""The cache of machine code: one file for each kernel and its types; see ``files.cache``."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from ...files.cache import Cache, sealed, unsealed

__all__ = ["cache_folder", "file_digest", "holds", "load", "save", "sealed", "unsealed"]

CACHE = Cache("kernels", ".o")


def cache_folder() -> Path:
    """Return the cache folder of machine code.

    Raises:
        OSError: the user has no home.
    """
    if CACHE.folder is None:
        raise OSError("this user has no home folder to keep machine code in")
    return CACHE.folder


def load(name: str) -> bytes | None:
    """Load the machine code called ``name``; ``None`` where there is none that may be used."""
    return CACHE.load(_place(name))


def holds(name: str) -> bool:
    """Return whether there is a file for the machine code called ``name``."""
    return CACHE.holds(_place(name))


def save(name: str, code: bytes) -> None:
    """Keep machine code; where the folder cannot be written it is simply not kept."""
    CACHE.save(_place(name), code)


@cache
def file_digest(file: str) -> str:
    """Return the digest of a file's content. Raises ``OSError`` where there is none."""
    return hashlib.blake2b(Path(file).read_bytes(), digest_size=16).hexdigest()


def _place(name: str) -> str:
    return f"{name[:2]}/{name[2:]}"
