"""Results that take long to compute, kept in the user's cache folder between processes.

They are found again under a digest of everything that decides on them: data given by the caller, the code
and libraries (``code_digest``), and what NumPy may compute with on this processor. So they are the bits that
computing them again would give, and where nothing can be read or written they are computed again.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]

MOST_FILES = 256
"""Number of results that are kept; beyond it, the least recently used are deleted."""

_MARK = "array "


def kept_folder() -> Path:
    """Return the folder of kept results: ``aloft/arrays`` in the user's cache folder."""
    root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(root) / "aloft" / "arrays"


def kept_arrays(decided_by: bytes, compute: Callable[[], Arrays]) -> Arrays:
    """Return the arrays that ``compute`` gives, computed only if they are not kept.

    Args:
        decided_by: everything on which the arrays depend, or a digest of it: the data and, as
            ``package_code.code_digest`` gives it, the code. Nothing is kept of an error.
    """
    name = hashlib.blake2b(decided_by + processor(), digest_size=16).hexdigest()
    place = kept_folder() / f"{name}.npz"
    found = _read(place)
    if found is None:
        found = compute()
        with suppress(OSError):  # no place for it: computed again the next time
            _write(place, found)
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


def _read(place: Path) -> Arrays | None:
    """Read the arrays kept in a file; ``None`` where there is none, or it is damaged."""
    try:
        with np.load(place, allow_pickle=False) as file:
            found = {name.removeprefix(_MARK): file[name] for name in file.files}
        os.utime(place)
    except Exception:  # noqa: BLE001  # of a damaged file NumPy and zipfile raise errors of many types
        return None
    return found


def _write(place: Path, arrays: Arrays) -> None:
    place.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=place.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            save: Any = np.savez
            # marked, as an array may be called like a parameter of savez
            save(file, **{f"{_MARK}{name}": array for name, array in arrays.items()})
        os.replace(temporary, place)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    kept = sorted(place.parent.iterdir(), key=lambda path: path.stat().st_mtime)
    for old in kept[:-MOST_FILES]:
        old.unlink(missing_ok=True)


LIBRARIES = ("numpy", "pin")
"""Libraries that compute, beside this package."""


@cache
def code_digest(*folders: str) -> bytes:
    """Hash all source files in these folders of the package, such as ``planner/models``, and the
    versions of the libraries that compute."""
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
