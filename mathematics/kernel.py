"""Kernels are the functions with the time-critical mathematics, marked so that they can be found
and compiled.

A kernel runs as plain Python and also compiles, unchanged, in Numba's nopython mode. So it uses
only what both support and compute alike:

* Arguments are arrays, floats, ints, bools, and named tuples of these, by position; no defaults,
  keywords or other objects. Arrays that belong together travel as one named tuple.
* Results go into arrays of the caller, or are returned as numbers or a tuple of numbers. Nothing is
  allocated: scratch memory is an argument too.
* It calls other kernels, ``math``, and NumPy's functions in the form that writes into a given
  array, with the array passed by position: ``np.subtract(a, b, out)``. ``np.minimum`` and
  ``np.maximum`` take it only as a keyword, so kernels cannot use them. It uses no lists, dicts,
  strings or comprehensions.
* It raises no errors, reads no globals except constants, and is deterministic.
* Elements of arrays are read with ``float`` or ``int``, which makes plain Python faster and costs
  nothing when compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])

_kernels: dict[str, Callable[..., Any]] = {}


def kernel(function: _Function) -> _Function:
    """Mark a function of a module as a kernel; the function itself stays unchanged."""
    _kernels[f"{function.__module__}.{function.__qualname__}"] = function
    return function


def kernels() -> dict[str, Callable[..., Any]]:
    """The kernels of all modules imported so far, by ``module.name`` in order of definition."""
    return dict(_kernels)
