"""Judges kernels by NumPy, which runs them as they are written: their equations become loops elsewhere.

The untouched function runs on copies of the arguments, with signals whose scalar fields are numbers, and functions of
numbers that take whole arrays. What NumPy does not take is not judged.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.expressions import cross
from ...mathematics.compiling.fingerprint import numba_functions
from ...mathematics.compiling.kernel_registry import (
    arguments_of,
    is_kernel,
    reports_event,
    written_code,
)
from ...mathematics.compiling.kinds import ArrayKind, Kind, RecordKind, argument_kinds
from ...mathematics.compiling.numba_calls import is_numba, names_read

DISTURBANCE = 2.0**-44
"""The change of numbers, relative to each, that shows how far rounding may go."""
TRIALS = 4


class NotJudged(Exception):
    """NumPy does not take this kernel as it is written."""


class WrittenRecord:
    """A signal, or other record, as a kernel's text sees it."""

    def __init__(self, parts: Any, kind: Kind) -> None:
        object.__setattr__(self, "_parts", parts)
        object.__setattr__(self, "_kinds", kind.parts if isinstance(kind, RecordKind) else {})

    def __getattr__(self, name: str) -> Any:
        return _read(getattr(self._parts, name), self._kinds.get(name))

    def __setattr__(self, name: str, value: Any) -> None:
        getattr(self._parts, name)[()] = value


def _read(value: Any, kind: Kind) -> Any:
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return WrittenRecord(value, kind)
    if isinstance(value, np.ndarray) and value.ndim == 0:
        number = value.item()
        if isinstance(kind, ArrayKind) and kind.words:
            return kind.words[int(number)]
        made = (_Fraction if isinstance(number, float) else _Whole)(number)
        made.memory = value
        return made
    return value


class _Fraction(float):
    """A scalar field: a number, which is also read and written like an array without dimensions."""

    memory: NDArray[Any]

    def __getitem__(self, place: Any) -> Any:
        return self.memory[place].item()

    def __setitem__(self, place: Any, value: Any) -> None:
        self.memory[place] = value


class _Whole(int):
    """The same of whole numbers and flags."""

    memory: NDArray[Any]
    __getitem__, __setitem__ = _Fraction.__getitem__, _Fraction.__setitem__


def by_numpy(kernel: Any, arguments: Sequence[Any]) -> None:
    """Run a kernel as it is written on arguments, which it changes.

    Raises:
        NotJudged: NumPy, or Python, does not take it; also where it raises an error of its own.
    """
    written = _as_written(kernel)
    if written is None:
        raise NotJudged
    kinds = argument_kinds(kernel)
    names = arguments_of(kernel)
    given = [
        _read(value, kinds.get(name)) if isinstance(value, tuple) else value
        for name, value in zip(names, arguments, strict=False)
    ]
    try:
        with np.errstate(all="ignore"):
            answer = written(*given)
            if reports_event(kernel):
                arguments[len(names)][0] = bool(answer)
    except Exception as error:
        raise NotJudged from error


@lru_cache(64)
def _as_written(kernel: Any) -> Callable[..., Any] | None:
    """Return a kernel as it is written, or None if NumPy cannot take it."""
    if kernel.__closure__ is not None:
        return None
    if any("random" in names_read(each) for each in numba_functions(kernel)):
        return None  # Numba has a stream of its own
    return _written(kernel, {})


def difference(kernel: Any, arguments: Sequence[Any], found: Sequence[Any]) -> str:
    """Return how what a kernel has made of its arguments differs from NumPy's; empty where it does by no more than
    rounding.

    Args:
        arguments: as they were before.
        found: the same after the call.

    Raises:
        NotJudged: NumPy does not take it, or rounding decides between two ways.
    """
    expected = copied(arguments)
    by_numpy(kernel, expected)
    pairs = zip(arrays_in(found), arrays_in(expected), strict=True)
    if all(one.tobytes() == other.tobytes() for one, other in pairs):
        return ""  # no rounding to explain
    spread = [np.zeros(each.shape) for each in arrays_in(expected)]
    chance = np.random.default_rng(0)
    at_threshold = False
    for _ in range(TRIALS):
        trial = copied(arguments)
        for each in arrays_in(trial):
            if each.dtype.kind == "f":
                each *= 1.0 + DISTURBANCE * chance.choice((-1.0, 1.0), each.shape)
        try:
            by_numpy(kernel, trial)
        except NotJudged:
            continue
        rows = list(zip(arrays_in(trial), arrays_in(expected), strict=True))
        if any(a.dtype.kind != "f" and a.tobytes() != b.tobytes() for a, b in rows):
            at_threshold = (
                True  # rounding decides; what follows from the other decision says nothing
            )
            continue
        for k, (one, other) in enumerate(rows):
            if one.dtype.kind == "f":
                with np.errstate(invalid="ignore"):
                    spread[k] = np.fmax(spread[k], np.abs(one - other))
    for one, other, allowed in zip(arrays_in(found), arrays_in(expected), spread, strict=True):
        if one.dtype.kind != "f":
            near = one == other
        else:
            with np.errstate(invalid="ignore"):
                near = np.abs(one - other) <= 4.0 * allowed + 2.0 * np.spacing(np.abs(other))
            near |= (one == other) | (np.isnan(one) & np.isnan(other))
        if not np.all(near):
            if at_threshold:
                raise NotJudged
            return f"{np.array2string(one, threshold=20)} where NumPy has {np.array2string(other, threshold=20)}"
    return ""


def copied(values: Sequence[Any]) -> list[Any]:
    """Copy arguments; arrays that are the same memory stay so."""
    made: dict[tuple[Any, ...], NDArray[Any]] = {}

    def one(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            key = value.ctypes.data, value.shape, value.strides
            return made.setdefault(key, value.copy(order="K"))
        if isinstance(value, tuple):
            return type(value)(*map(one, value)) if hasattr(value, "_fields") else value
        return value

    return [one(each) for each in values]


def arrays_in(values: Any) -> list[NDArray[Any]]:
    """Return all arrays of arguments, also in records."""
    if isinstance(values, np.ndarray):
        return [values]
    return (
        [found for each in values for found in arrays_in(each)]
        if isinstance(values, list | tuple)
        else []
    )


def _written(kernel: Any, made: dict[int, Callable[..., Any]]) -> Callable[..., Any]:
    """Return a kernel as it is written, which calls others as they are written."""
    if id(kernel) in made:
        return made[id(kernel)]
    names = dict(kernel.__globals__)
    function = types.FunctionType(written_code(kernel), names, kernel.__name__, kernel.__defaults__)
    notes = [kernel.__annotations__.get(name) for name in arguments_of(kernel)]
    of_numbers = bool(notes) and all(note in _NUMBERS for note in notes)
    made[id(kernel)] = _of_elements(function) if of_numbers else function
    for name in written_code(kernel).co_names:
        value = names.get(name)
        if is_kernel(value):
            names[name] = _written(value, made)
        elif is_numba(value):
            names[name] = _written_for_numba(value, made)
        elif isinstance(value, types.ModuleType) and value is math:
            names[name] = _MATH
        elif isinstance(value, types.ModuleType):
            names[name] = _Written(value, made)
    names |= _BUILTINS
    names.update({name: np.cross for name, value in names.items() if value is cross})
    return made[id(kernel)]


def _written_for_numba(function: Any, made: dict[int, Callable[..., Any]]) -> Callable[..., Any]:
    """Return a function of Numba as it is written, which calls others as they are written."""
    if id(function) not in made:
        written = function.py_func
        names = dict(written.__globals__)
        made[id(function)] = types.FunctionType(
            written.__code__, names, written.__name__, written.__defaults__, written.__closure__
        )
        called = {name: names.get(name) for name in written.__code__.co_names}
        names |= {n: _written_for_numba(each, made) for n, each in called.items() if is_numba(each)}
    return made[id(function)]


class _Written:
    """A module whose kernels are as they are written."""

    def __init__(self, module: Any, made: dict[int, Callable[..., Any]]) -> None:
        self._module, self._made = module, made

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._module, name)
        if value is cross:
            return np.cross
        return _written(value, self._made) if is_kernel(value) else value


def _of_elements(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of numbers that also takes arrays, whose elements it is applied to."""

    def applied(*arguments: Any, **named: Any) -> Any:
        if named or (function in (min, max) and len(arguments) == 1):
            return function(*arguments, **named)
        if any(isinstance(each, np.ndarray) and each.ndim for each in arguments):
            rows = np.broadcast_arrays(*arguments)
            values = [
                function(*(each.item() for each in row))
                for row in zip(*(each.flat for each in rows), strict=True)
            ]
            return np.array(values).reshape(rows[0].shape)
        return function(*arguments)

    return applied


_NUMBERS = ("float", "int", "bool", float, int, bool)
_BUILTINS: Mapping[str, Any] = {
    each.__name__: _of_elements(each) for each in (min, max, abs, round, float, int, bool)
}
_MATH = types.SimpleNamespace(
    **{
        name: _of_elements(value) if callable(value) else value
        for name, value in vars(math).items()
    }
)
