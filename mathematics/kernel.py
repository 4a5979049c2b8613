"""Kernels: the functions with the hot mathematics, marked so that they can be found and compiled.

A kernel runs as plain Python and compiles as it stands, in Numba's nopython mode; so it keeps to
what both know and do alike:

* Arguments are arrays, floats, ints, bools, and named tuples of these, by position; no defaults,
  keywords or other objects. Arrays that belong together travel as one named tuple.
* Results go into arrays of the caller, or are returned as numbers or a tuple of numbers. Nothing is
  allocated: scratch memory is an argument too.
* It calls other kernels, ``math``, and NumPy's functions in the form that writes into a given array,
  the array by position: ``np.subtract(a, b, out)``; not ``np.minimum`` and ``np.maximum``, which
  want it as a keyword. No lists, dicts, strings, comprehensions.
* It raises nothing, reads no globals but constants, and is deterministic.
* Scalars of arrays are read with ``float`` or ``int``: faster in Python, and nothing when compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])

_kernels: dict[str, Callable[..., Any]] = {}


def kernel(function: _Function) -> _Function:
    """Mark a function of a module as a kernel. It stays the same function and costs nothing."""
    _kernels[f"{function.__module__}.{function.__qualname__}"] = function
    return function


def kernels() -> dict[str, Callable[..., Any]]:
    """The kernels of all modules imported so far, by ``module.name`` in order of definition."""
    return dict(_kernels)
