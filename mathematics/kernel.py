"""Kernels are the functions with the time-critical mathematics, marked so that they can be found
and compiled.

A kernel runs as plain Python and as machine code, with the same bits. It is written as equations::

    @kernel
    def filter_velocity(R: Array2D, v: Array1D, memory: FilterState, alpha: float) -> None:
        memory.velocity[:] = alpha * memory.velocity + (1.0 - alpha) * (R @ v)
        memory.count = memory.count + 1

Before it runs or is compiled, ``compiling/equations`` rewrites statements on whole arrays into loops. What a
kernel may use:

* Arguments are arrays, floats, ints, bools, signals, and named tuples of these; no other objects. An
  argument says its type; ``Array1D`` and ``Array2D`` say how many dimensions there are. A scalar field
  of a signal reads and is assigned like a number.
* Results go into arrays of the caller, or are returned as numbers or a tuple of numbers. An array of
  the kernel's own has a constant size: ``np.zeros(3)``; other scratch memory is an argument.
* ``x[:] = ...``, ``x[::2] += ...`` and ``A[i, :] = ...`` with ``+ - * /``, ``R @ v``, ``R.T``,
  ``cross(a, b)``, NumPy's functions, and functions of numbers, which apply to each element. Sums go
  from the first to the last. ``a @ b`` of two vectors, ``np.sum(a)`` and the like are numbers.
* Loops go over ``range``, arrays, ``enumerate`` and ``zip``. It calls other kernels and ``math``. It uses no
  lists, dicts, strings or comprehensions. A member of an ``IntEnum`` stands for its number.
* It raises no errors, reads no globals except constants, and is deterministic.
"""

from __future__ import annotations

from collections.abc import Callable
from types import CodeType, FunctionType
from typing import Any, TypeVar

from .compiling.kernel_registry import arguments_of, is_kernel, register, written_code

_Function = TypeVar("_Function", bound=Callable[..., Any])

_expanded: set[int] = set()


def kernel(function: _Function) -> _Function:
    """Mark a function as a kernel: of a module, or a step in the class of a block.

    It stays a plain function. Its equations become loops when it is first called.
    """
    plain: Any = function.__func__ if isinstance(function, staticmethod) else function
    if register(plain):
        plain.__code__ = _expanding_code(plain)
    return function


def expand(function: Any) -> None:
    """Replace the equations of a kernel by loops, if that has not been done.

    Raises:
        EquationError: a statement cannot be rewritten; the text gives place and reason.
    """
    if id(function) not in _expanded and is_kernel(function) and function.__closure__ is None:
        code = written_code(function)
        if not _takes_numbers_only(function):
            from .compiling.kept_expansions import kept_expansion

            code = kept_expansion(function, code)
        function.__code__ = code
        _expanded.add(id(function))


def _takes_numbers_only(function: FunctionType) -> bool:
    """Return whether a kernel has no arrays, and so no equations."""
    kinds = [function.__annotations__.get(name) for name in arguments_of(function)]
    return bool(kinds) and all(kind in ("float", "int", "bool") for kind in kinds)


def _expanding_code(function: FunctionType) -> CodeType:
    """Code that expands a kernel when it is first called, and then calls it."""

    def call(*arguments: Any, **keywords: Any) -> Any:
        expand(function)
        return function(*arguments, **keywords)

    def stand_in(*arguments: Any, **keywords: Any) -> Any:
        target: Any = "call"
        return target(*arguments, **keywords)

    written, code = function.__code__, stand_in.__code__
    return code.replace(
        co_consts=tuple(call if constant == "call" else constant for constant in code.co_consts),
        co_name=written.co_name, co_qualname=written.co_qualname,
        co_filename=written.co_filename, co_firstlineno=written.co_firstlineno,
    )  # fmt: skip
