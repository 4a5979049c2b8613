"""The arguments of a kernel as machine code gets them: types, and one row of 64-bit words.

A number is one word. An array is its address, its shape and its strides in bytes. A named tuple is its
parts, one after the other. Before the arguments there are two words with which machine code reports a
division by zero to Python.
"""

from __future__ import annotations

import ctypes
from collections import namedtuple
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .failures import FAILURES, Failure

HEADER = 2
"""The number of words before the arguments."""


@dataclass(frozen=True)
class NumberType:
    """A number of Python: ``float``, ``int`` or ``bool``."""

    kind: str

    def __str__(self) -> str:
        return self.kind


@dataclass(frozen=True)
class ArrayType:
    """An array: its dtype's name, its number of dimensions, and its order in memory.

    ``order`` is C (rows in sequence), F (columns in sequence) or A (any strides).
    """

    dtype: str
    dimensions: int
    order: str

    def __str__(self) -> str:
        return f"{self.dtype}[{self.dimensions}{self.order}]"


@dataclass(frozen=True)
class RecordType:
    """A named tuple: its class and the types of its parts."""

    kind: type
    parts: tuple[ArgumentType, ...]

    def __reduce__(self) -> tuple[Any, ...]:
        if self.kind.__module__ == __name__:  # made by ``record_type``
            names = getattr(self.kind, "_fields", ())
            return _same_record, (self.kind.__name__, names, self.parts)
        return RecordType, (self.kind, self.parts)

    def __str__(self) -> str:
        parts = ",".join(map(str, self.parts))
        names = ",".join(getattr(self.kind, "_fields", ()))
        return f"{self.kind.__module__}.{self.kind.__qualname__}:{names}({parts})"


@cache
def record_type(name: str, fields: tuple[str, ...]) -> type:
    """Make the named tuple of some fields of a signal or of parameters: one class for each
    choice."""
    made = namedtuple(name, fields)  # type: ignore[misc]  # the names are known only now
    made.__module__ = __name__
    return made


def _same_record(name: str, fields: tuple[str, ...], parts: tuple[ArgumentType, ...]) -> RecordType:
    return RecordType(record_type(name, fields), parts)


ArgumentType = NumberType | ArrayType | RecordType


def type_of(argument: Any) -> ArgumentType:
    """Return the type of an argument. Raises ``TypeError`` for what a kernel cannot take."""
    if isinstance(argument, np.ndarray):
        flags = argument.flags
        order = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return _array_type(argument.dtype, argument.ndim, order)
    if isinstance(argument, tuple) and hasattr(argument, "_fields"):
        return _record_type(type(argument), tuple(map(type_of, argument)))
    if isinstance(argument, bool | np.bool_):
        return _BOOL
    if isinstance(argument, int):
        return _INT
    if isinstance(argument, float):
        return _FLOAT
    raise TypeError(
        f"a kernel takes arrays, floats, ints, bools and named tuples of these, and not a "
        f"{type(argument).__name__}"
    )


_FLOAT, _INT, _BOOL = NumberType("float"), NumberType("int"), NumberType("bool")


@cache
def _array_type(dtype: np.dtype[Any], dimensions: int, order: str) -> ArrayType:
    """One object for equal types, which are compared a thousand times in a load; NumPy also composes the
    name of a dtype anew each time."""
    return ArrayType(dtype.name, dimensions, order)


@cache
def _record_type(kind: type, parts: tuple[ArgumentType, ...]) -> RecordType:
    """Make a record type; cached, as in ``_array_type``."""
    return RecordType(kind, parts)


def pack(arguments: tuple[Any, ...]) -> NDArray[np.int64]:
    """Pack the words of all arguments in a row. They hold addresses: keep the arrays alive."""
    words = list(_error_words())
    for argument in arguments:
        _append(argument, words)
    return np.array(words, dtype=np.int64)


@cache
def error_record() -> NDArray[np.int64]:
    """Return the record with which machine code reports errors: whether one was reported, the status,
    the address of Python's function that sets an error, and those of the errors, by kind."""
    function = ctypes.cast(ctypes.pythonapi.PyErr_SetString, ctypes.c_void_p).value
    kinds = [id(FAILURES[failure][0]) for failure in Failure]
    return np.array([0, 0, function or 0, *kinds], np.int64)


@cache
def _error_words() -> tuple[int, int]:
    """Return the address of the function that reports an error, and that of its record."""
    from .machine_code import machine_code_of

    return machine_code_of(_report_module).address, int(error_record().ctypes.data)


def _report_module() -> Any:
    """Make the function that reports an error: it sets it for Python and marks it in the record."""
    from llvmlite import ir

    from .machine_code import ENTRY

    word, text = ir.IntType(64), ir.IntType(8).as_pointer()
    module = ir.Module("aloft.report")
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [word, text, word]), ENTRY)
    builder = ir.IRBuilder(function.append_basic_block())
    record, message, status = function.args
    words = builder.inttoptr(record, word.as_pointer())
    builder.store(ir.Constant(word, 1), words)
    builder.store(status, builder.gep(words, [ir.Constant(word, 1)]))
    address = builder.load(builder.gep(words, [ir.Constant(word, 2)]))
    kind = builder.add(builder.and_(status, ir.Constant(word, 15)), ir.Constant(word, 3))
    error = builder.load(builder.gep(words, [kind]))
    set_error = ir.FunctionType(ir.VoidType(), [word, text]).as_pointer()
    builder.call(builder.inttoptr(address, set_error), [error, message])
    builder.ret_void()
    return module


def _append(argument: Any, words: list[int]) -> None:
    if isinstance(argument, np.ndarray):
        words.append(argument.ctypes.data)
        words += argument.shape
        words += argument.strides
    elif isinstance(argument, tuple):
        for part in argument:
            _append(part, words)
    elif isinstance(argument, float):
        words.append(int(np.float64(argument).view(np.int64)))
    else:
        words.append(int(argument))
