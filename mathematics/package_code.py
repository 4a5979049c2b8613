"""What a result that is kept between processes depends on beside its own data: code and libraries."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib import metadata
from pathlib import Path

LIBRARIES = ("numpy", "pin")
"""What computes, beside this package."""


@cache
def code_digest(*folders: str) -> bytes:
    """A digest of all source files in these folders of the package, such as ``planner/models``, and
    of the versions of the libraries that compute."""
    root, digest = Path(__file__).parents[1], hashlib.blake2b(digest_size=16)
    for folder in folders:
        for path in sorted((root / folder).rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    for name in LIBRARIES:
        try:
            digest.update(f"{name} {metadata.version(name)}\n".encode())
        except metadata.PackageNotFoundError:
            continue
    return digest.digest()
