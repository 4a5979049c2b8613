"""Machine code that a wheel brings along, so that a machine's first run compiles next to nothing.

One archive for each kind of processor stands beside this file, ``TRIPLE.zip``, for the oldest processor
of the kind; the release makes them. An entry is named by what its machine code was made of: the files of
the kernel and of all that it calls, the constants they read, the types, the compiler's own files, LLVM's
version. Where any of these differs, no entry has the name, and the kernel is compiled.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import store
from .arguments import ArgumentType
from .fingerprint import fingerprint
from .machine_code import OLDEST, OPTIONS, cross_compiled, llvm_version, process_triple

if TYPE_CHECKING:
    from zipfile import ZipFile

FOLDER = Path(__file__).parent
_SAME_DATE = (1980, 1, 1, 0, 0, 0)
"""Date of all entries, so that equal machine code gives equal archives."""

Kernel = tuple[Callable[..., Any], tuple[ArgumentType, ...]]
"""A kernel and the types of its arguments."""


def load(kernel: Callable[..., Any], signature: tuple[ArgumentType, ...]) -> bytes | None:
    """Load the machine code of a kernel from the package.

    Returns:
        ``None`` where there is none that was made of the same sources by the same tools, where it is
        damaged, or where ``ALOFT_CPU_NAME`` asks for code for a certain processor.
    """
    triple = process_triple()
    archive = None if os.environ.get("ALOFT_CPU_NAME") else _archive(FOLDER / f"{triple}.zip")
    if archive is None:
        return None
    from zipfile import BadZipFile

    try:
        name = _name(kernel, signature, triple)
        return store.unsealed(name, archive.read(name))
    except (KeyError, OSError, BadZipFile):
        return None


@cache
def _archive(file: Path) -> ZipFile | None:
    if not file.is_file():
        return None
    from zipfile import BadZipFile, ZipFile

    try:
        return ZipFile(file)
    except (OSError, BadZipFile):
        return None


def _name(kernel: Callable[..., Any], signature: tuple[ArgumentType, ...], triple: str) -> str:
    return fingerprint(kernel, signature, _tools(triple), by_source=True)


@cache
def _tools(triple: str) -> str:
    compiler = [store.file_digest(str(file)) for file in sorted(FOLDER.glob("*.py"))]
    return "; ".join((f"llvmlite {llvm_version()}", triple, OLDEST[triple], OPTIONS, *compiler))


def write(kernels: Iterable[Kernel], triple: str, folder: Path = FOLDER) -> Path:
    """Compile kernels for the oldest processor of a kind, and write the archive.

    Raises:
        CompileError: a kernel does what compiled code cannot.
    """
    from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

    from .translate import Translator

    translator = Translator()
    made: dict[str, bytes] = {}
    for kernel, signature in kernels:
        name = _name(kernel, signature, triple)
        code = cross_compiled(translator.module(kernel, signature), triple, OLDEST[triple])
        made[name] = store.sealed(name, code)
    file = folder / f"{triple}.zip"
    with ZipFile(file, "w", ZIP_DEFLATED) as archive:
        for name in sorted(made):
            archive.writestr(ZipInfo(name, _SAME_DATE), made[name], ZIP_DEFLATED)
    return file
