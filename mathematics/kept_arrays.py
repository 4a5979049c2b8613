"""Results that take long to compute, kept in the user's cache folder between processes.

They are found again under a digest of everything that decides on them: data given by the caller, the code
and libraries (``code_digest``), and what NumPy may compute with on this processor. So they are the bits that
computing them again would give, and where nothing can be read or written they are computed again.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ..files.cache import Cache

Arrays = Mapping[str, NDArray[Any]]

CACHE = Cache("arrays", ".npz", most=256)
_MARK = "array "


def kept_arrays(decided_by: bytes, compute: Callable[[], Arrays]) -> Arrays:
    """Return the arrays that ``compute`` gives, computed only if they are not kept.

    Args:
        decided_by: everything on which the arrays depend, or a digest of it: the data and, as
            ``code_digest`` gives it, the code. Nothing is kept of an error.
    """
    name = hashlib.blake2b(decided_by + processor(), digest_size=16).hexdigest()
    found = _read(name)
    if found is None:
        found = compute()
        _write(name, found)
    return found


@cache
def processor() -> bytes:
    """Describe the processor as NumPy and its BLAS see it when they choose routines, which do not
    all round alike."""
    known: Any = {}
    with suppress(ImportError, AttributeError):
        known = import_module("numpy._core._multiarray_umath").__cpu_features__
    features = [name for name, present in sorted(known.items()) if present]
    return repr((features, os.environ.get("OPENBLAS_CORETYPE", ""))).encode()


def _read(name: str) -> Arrays | None:
    """Return the arrays that are kept under a name; ``None`` where there are none that may be used."""
    data = CACHE.load(name)
    if data is None:
        return None
    try:
        with np.load(BytesIO(data), allow_pickle=False) as file:
            return {name.removeprefix(_MARK): file[name] for name in file.files}
    except Exception:  # noqa: BLE001  # of a file of another form NumPy and zipfile raise errors of many types
        return None


def _write(name: str, arrays: Arrays) -> None:
    memory, save = BytesIO(), cast(Any, np.savez)
    # marked, as an array may be called like a parameter of savez
    save(memory, **{f"{_MARK}{key}": array for key, array in arrays.items()})
    CACHE.save(name, memory.getvalue())


LIBRARIES = ("numpy", "pin")
"""Libraries that compute, beside this package."""


def code_digest(*folders: str) -> bytes:
    """Hash all source files in these folders of the package, such as ``planner/models``, and the
    versions of the libraries that compute."""
    parts = [_folder_digest(folder) for folder in folders]
    return hashlib.blake2b(b"".join(parts) + _versions(), digest_size=16).digest()


@cache
def _folder_digest(folder: str) -> bytes:
    root, digest = Path(__file__).parents[1], hashlib.blake2b(digest_size=16)
    for path in sorted((root / folder).rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.digest()


@cache
def _versions() -> bytes:
    """Return what the folders of the libraries' metadata are called, such as ``numpy-2.4.6.dist-info``: to import what
    reads them takes a twentieth of a start."""
    found = [
        next(filter(None, (sorted(p.name for p in Path(place).glob(f"{name}-*-info")) for place in sys.path)), [])
        for name in LIBRARIES
    ]  # fmt: skip
    return repr(found).encode()
