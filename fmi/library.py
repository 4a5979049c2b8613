"""Mends a fault of the libraries in FMUs of PythonFMU and PythonFMU3: a crash as a process ends."""

from __future__ import annotations

import atexit
import ctypes
import os
import sys
from pathlib import Path

_REGISTERED: dict[int, ctypes.CDLL] = {}


def release_at_exit(binaries: Path) -> None:
    """Have an FMU's library, if this process has loaded it, let go of Python before the exit.

    PythonFMU3 keeps its hold on Python in a static ``shared_ptr``. On Linux its destructor frees
    what that holds, and after it the library's ``__attribute__((destructor))`` assigns to the
    destroyed pointer, which counts down in the freed memory. Sometimes glibc then finds its heap
    damaged ("corrupted double-linked list") and aborts a process whose work was done. The library
    exports the function that sets the pointer to null. Called before, while everything lives, it
    leaves the other two nothing to free. Of other FMUs' libraries nothing is called.

    Args:
        binaries: the folder ``binaries`` of the unpacked FMU.
    """
    if sys.platform != "linux":
        return
    for file in sorted(binaries.glob("*/*.so")):
        try:
            library = ctypes.CDLL(str(file), mode=os.RTLD_NOLOAD | os.RTLD_LAZY)
            release = library.finalizePythonInterpreter
        except (OSError, AttributeError):  # not loaded here, or not made by PythonFMU
            continue
        if library._handle not in _REGISTERED:
            _REGISTERED[library._handle] = library
            release.restype = None
            atexit.register(release)
