"""The functions that are marked as kernels, and their code as it was written."""

from __future__ import annotations

from collections.abc import Callable
from types import CodeType
from typing import Any

_kernels: dict[str, Callable[..., Any]] = {}
_marked: dict[int, Callable[..., Any]] = {}
"""All of them by identity, also those whose names were taken again; kept, so that no other function gets one."""
_written: dict[int, CodeType] = {}
"""The code of each kernel before its equations become loops, by the identity of the function."""


def register(function: Any) -> bool:
    """Take a function into the list; returns whether its equations can be rewritten."""
    _kernels[f"{function.__module__}.{function.__qualname__}"] = function
    _marked[id(function)] = function
    if function.__closure__ is not None:
        return False
    _written[id(function)] = function.__code__
    return True


def kernels() -> dict[str, Callable[..., Any]]:
    """Return the kernels of all modules imported so far, by ``module.name`` in order of
    definition."""
    return dict(_kernels)


def is_kernel(function: object) -> bool:
    """Return whether a function is marked as a kernel."""
    return id(function) in _marked


def written_code(function: Any) -> CodeType:
    """Return the code of a function as it was written; of a kernel, before its equations become
    loops."""
    code: CodeType = _written.get(id(function), function.__code__)
    return code


def reports_event(function: Any) -> bool:
    """Return whether a kernel is a block's step that returns whether ``on_event`` is to be
    called."""
    returns = function.__annotations__.get("return")
    return hasattr(function, "declared_kinds") and returns in ("bool", bool)


def arguments_of(function: Any) -> tuple[str, ...]:
    """Return the names of a function's arguments."""
    code = written_code(function)
    return code.co_varnames[: code.co_argcount]
