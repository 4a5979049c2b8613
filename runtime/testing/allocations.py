"""Counts every array that NumPy allocates, also those that live only within one expression.

It uses NumPy's hook for memory handlers (NEP 49): within a ``with`` statement our handler counts
and then calls the default handler. Views allocate no data and are not counted. Only the arrays of
the present thread are counted.

NumPy offers the hook to C only, so it is reached with ctypes through the table of functions that is
part of NumPy's binary interface. Ways without ctypes would miss arrays:

* ``tracemalloc`` knows which arrays are alive when a snapshot is taken. An array that lives for one
  expression, as in ``a + b * c``, is gone by then: after a hundred of them it counts none.
* A subclass of ``ndarray`` sees only operations on its own instances: neither ``np.zeros(3)`` nor
  arrays made inside a library; and the blocks would not run as they do without it.

If a release of NumPy changes this interface, the counter raises an error when it is first used; it
does not count wrongly.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from types import FrameType
from typing import Any, ClassVar

import numpy as np

_SET_HANDLER, _GET_HANDLER, _DEFAULT_HANDLER = 304, 305, 306
"""Places in NumPy's table of C functions, which are fixed by its binary interface."""
_PLACES_KEPT = 5
_BOXED = 8
"""The most bytes that count as a single number."""

_Malloc = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
_Calloc = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t)
# the default's functions must be called with the interpreter's lock held, as NumPy does
_HeldMalloc = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
_HeldCalloc = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t)


class _Handler(ctypes.Structure):
    """NumPy's ``PyDataMem_Handler``, version 1."""

    version_known: ClassVar[int] = 1

    _fields_ = [
        ("name", ctypes.c_char * 127),
        ("version", ctypes.c_uint8),
        ("context", ctypes.c_void_p),
        ("malloc", ctypes.c_void_p),
        ("calloc", ctypes.c_void_p),
        ("realloc", ctypes.c_void_p),
        ("free", ctypes.c_void_p),
    ]


@dataclass
class Allocations:
    """The number of arrays that were allocated, their bytes, and where the first few were made.

    ``boxed`` counts separately the small objects that NumPy makes for single numbers, such as the
    factor in ``np.multiply(u, 0.5, out=y)`` or the result of ``np.dot(u, u)``. They take up to
    eight bytes of a cache and cost no more than a Python float. A 0-d array for the factor, and
    ``out=``, avoid them.
    """

    count: int = 0
    boxed: int = 0
    total_bytes: int = 0
    places: list[str] = field(default_factory=list)


class _Counter:
    """The memory handler. There is one for the life of the process, because every array keeps a
    reference to the handler that allocated it."""

    def __init__(self) -> None:
        core: Any = import_module("numpy._core._multiarray_umath")

        pointer = ctypes.pythonapi.PyCapsule_GetPointer
        pointer.restype, pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
        table = ctypes.cast(pointer(core._ARRAY_API, None), ctypes.POINTER(ctypes.c_void_p))
        self._set = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object)(table[_SET_HANDLER])
        default = ctypes.cast(table[_DEFAULT_HANDLER], ctypes.POINTER(ctypes.py_object)).contents
        base = _Handler.from_address(pointer(default.value, b"mem_handler"))
        self._base_malloc = _HeldMalloc(base.malloc)
        self._base_calloc = _HeldCalloc(base.calloc)
        # free and realloc stay the default's: arrays may be freed while the interpreter shuts down
        self._malloc = _Malloc(self._count_malloc)
        self._calloc = _Calloc(self._count_calloc)
        self._handler = _Handler(
            b"aloft_allocation_counter",
            1,
            base.context,
            ctypes.cast(self._malloc, ctypes.c_void_p),
            ctypes.cast(self._calloc, ctypes.c_void_p),
            base.realloc,
            base.free,
        )
        make = ctypes.pythonapi.PyCapsule_New
        make.restype = ctypes.py_object
        make.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
        self._name = ctypes.create_string_buffer(b"mem_handler")
        self._capsule = make(
            ctypes.addressof(self._handler), ctypes.cast(self._name, ctypes.c_char_p), None
        )
        self.current: Allocations | None = None
        if base.version != _Handler.version_known or not self._counts():
            raise RuntimeError(
                f"the counter of arrays does not work with NumPy {np.__version__}: its memory "
                "handlers differ from those of NumPy 1.22 to 2"
            )

    def _counts(self) -> bool:
        """Return whether one array of a known size is counted as one."""
        self.current = found = Allocations()
        before = self.install()
        try:
            np.empty(999)
        finally:
            self.restore(before)
            self.current = None
        return (found.count, found.boxed, found.total_bytes) == (1, 0, 999 * 8)

    def _note(self, size: int, frame: FrameType | None) -> None:
        current = self.current
        if current is None:
            return
        if size <= _BOXED:
            current.boxed += 1
            return
        current.count += 1
        current.total_bytes += size
        if len(current.places) < _PLACES_KEPT and frame is not None:
            current.places.append(f"{frame.f_code.co_filename}:{frame.f_lineno}")

    def _count_malloc(self, context: Any, size: int) -> Any:
        self._note(size, sys._getframe().f_back)
        return self._base_malloc(context, size)

    def _count_calloc(self, context: Any, count: int, size: int) -> Any:
        self._note(count * size, sys._getframe().f_back)
        return self._base_calloc(context, count, size)

    def install(self) -> Any:
        """Make this NumPy's handler. Returns the handler that was in use."""
        return self._set(self._capsule)

    def restore(self, before: Any) -> None:
        """Make ``before`` the handler again."""
        self._set(before)


_counters: list[_Counter] = []


@contextmanager
def count_array_allocations() -> Iterator[Allocations]:
    """Count the arrays that are allocated within the ``with``::

    with count_array_allocations() as counted:
        block.step()
    assert counted.count == 0, counted.places

    Raises:
        RuntimeError: this release of NumPy has another interface; nothing is counted.
    """
    if not _counters:
        _counters.append(_Counter())
    counter = _counters[0]
    result = Allocations()
    outer = counter.current
    before = counter.install()
    counter.current = result
    try:
        yield result
    finally:
        counter.current = outer
        counter.restore(before)
