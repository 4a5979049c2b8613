"""Checks of the calls of somebody's kernels before a run: their equations, the sizes of their arrays, one plain run.

The sizes are those of the arrays that a call has, where the declarations leave them open. The plain run is made on
copies, so nothing changes; it ends after some thousand lines.
"""

from __future__ import annotations

import copy
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import FrameType
from typing import Any

import numpy as np

from ..kernel import expand
from .arguments import error_record, type_of
from .compile_calls import compile_calls
from .equations import check_equations
from .expressions import EquationError
from .failures import FAILURES
from .fingerprint import numba_functions
from .kernel_call import KernelCall
from .kernel_registry import written_code
from .kinds import ArrayKind, Kind, RecordKind, RuntimeSize, argument_kinds
from .numba_calls import NO_CODE, unseeded
from .translate import Translator

MOST_LINES = 100_000
"""Lines of Python after which a plain run ends; what it has not come to is not checked."""
_MISTAKES = (IndexError, AttributeError, TypeError, NameError, KeyError)
_SHAPES = ("broadcast", "shape", "sequence", "dimension", "unpack")
"""Words in the errors by which NumPy refuses sizes."""


class _Enough(BaseException):
    """The plain run has taken long enough."""


def mistake_in(kernel: Callable[..., Any], arguments: Sequence[Any], *, run: bool) -> str:
    """Return what is wrong with a call, with file and line; empty where nothing is.

    Args:
        run: whether to run a copy in plain Python, too.
    """
    try:
        expand(kernel)
        kinds = {
            name: _kind_of(value, kind)
            for (name, kind), value in zip(argument_kinds(kernel).items(), arguments, strict=False)
        }
        check_equations(kernel, kinds)
    except EquationError as error:
        return str(error)
    if numba_functions(kernel):
        return _mistake_of_numba(kernel, arguments)
    return _run_plainly(kernel, arguments) if run else ""


def explained(error: BaseException, calls: Iterable[KernelCall]) -> BaseException | None:
    """Return the error that plain Python raises in the place of one that machine code has reported, or the
    line that machine code knows; ``None`` where it was no machine code."""
    name, status = (
        str(error).partition(" ")[2].partition(" ")[2].split(" ")[0],
        int(error_record()[1]),
    )
    if not str(error).startswith("compiled kernel ") or not status:
        return None
    error_record()[1] = 0
    for call in calls:
        if call.compiled is None or call.name != name:
            continue
        found = _raised(call)
        if type(found) is type(error) or (found is not None and isinstance(error, RuntimeError)):
            place = _place_of(found, written_code(call.kernel).co_filename)
            return type(error)(
                f"{place}: {_described(found)}"
                if isinstance(error, RuntimeError)
                else f"{place}: {found}"
            )
        site = Translator().failure(call.kernel, tuple(map(type_of, call.arguments)), status)
        if site is not None:
            function, (failure, line) = site
            said = FAILURES[failure][1]
            return type(error)(
                f"{written_code(function).co_filename}:{line}: kernel {function.__qualname__} {said}"
            )
    return None


def _raised(call: KernelCall) -> Exception | None:
    """Return what plain Python raises for the present arguments of a call, on copies."""
    try:
        with np.errstate(all="ignore"):
            call.kernel(*map(_copied, call.arguments))
    except Exception as error:  # noqa: BLE001  # whatever it is, it is told
        return error
    return None


def _described(error: Exception | None) -> str:
    return f"{type(error).__name__}: {error}"


def _kind_of(value: Any, declared: Kind) -> Kind:
    """Return the kind of an argument, with the sizes that it has."""
    if (
        isinstance(value, np.ndarray)
        and isinstance(declared, ArrayKind)
        and value.ndim == declared.rank
    ):
        pairs = zip(declared.shape, value.shape, strict=True)
        shape = tuple(RuntimeSize(found) if size is None else size for size, found in pairs)
        return declared._replace(shape=shape)
    if isinstance(value, tuple) and isinstance(declared, RecordKind):
        parts: Mapping[str, Kind] = {
            **declared.parts,
            **{
                name: _kind_of(part, declared.parts.get(name))
                for name, part in zip(getattr(value, "_fields", ()), value, strict=False)
            },
        }
        return RecordKind(declared.name, parts)
    return declared


def _mistake_of_numba(kernel: Any, arguments: Sequence[Any]) -> str:
    """Return what is wrong with a kernel that calls functions of Numba: random numbers, or what Numba does not compile."""
    code = written_code(kernel)
    place = f"{code.co_filename}:{code.co_firstlineno}: kernel {kernel.__qualname__}: "
    for each in numba_functions(kernel):
        if drawing := unseeded(each):
            return (
                f"{place}numba function {drawing} draws random numbers without a seed, so no run could be repeated; let a "
                "block such as blocks.WhiteNoise draw them"
            )
    reason = compile_calls([KernelCall(kernel, *arguments)])  # what is compiled is kept for the run
    return place + reason if f" {NO_CODE}: " in reason else ""


def _run_plainly(kernel: Callable[..., Any], arguments: Sequence[Any]) -> str:
    left = MOST_LINES
    file = written_code(kernel).co_filename

    def count(frame: FrameType, event: str, argument: Any) -> Any:
        nonlocal left
        left -= 1
        if left < 0:
            raise _Enough
        return count

    before = sys.gettrace()
    try:
        if before is None:
            sys.settrace(count)
        with np.errstate(all="ignore"):
            kernel(*map(_copied, arguments))
    except _MISTAKES as error:
        return _placed(error, file)
    except ValueError as error:
        return _placed(error, file) if any(word in str(error) for word in _SHAPES) else ""
    except (_Enough, ArithmeticError):
        return ""
    finally:
        sys.settrace(before)
    return ""


def _copied(value: Any) -> Any:
    if isinstance(value, tuple):
        return type(value)(*map(_copied, value))
    return copy.copy(value)


def _placed(error: Exception, file: str) -> str:
    return f"{_place_of(error, file)}: {_described(error)}"


def _place_of(error: Exception | None, file: str) -> str:
    """Return the innermost line of a kernel that an error comes from."""
    place, frame = file, error.__traceback__ if error is not None else None
    while frame is not None:
        name = frame.tb_frame.f_code.co_filename
        if not name.endswith(("compiling/rehearsal.py", "compiling/numpy_numbers.py")):
            place = f"{name}:{frame.tb_lineno}"
        frame = frame.tb_next
    return place
