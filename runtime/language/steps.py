"""Steps that name their arguments: the runtime binds ports, state, scratch, constants by name.

::

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, x: Vector, constants: Constants) -> None:
        x.value[:] = constants.alpha * x.value + (1 - constants.alpha) * u.value
        y.value[:] = x.value

``step``, ``emit`` and ``update`` may be written so, as a ``@kernel`` or in plain Python. An argument is

* a port or a state, annotated with its signal;
* ``params``, ``constants`` or ``scratch``: ``Params``, ``Constants`` and ``Scratch`` of the class;
* ``clock``: the ``tick`` and the ``base_period`` [s] of the graph; ``period``: that of the block [s];
* an array, a number or a named tuple that ``setup`` has stored in the block under that name.

A kernel step that returns ``bool`` decides whether ``Block.on_event`` is called after it, for what
happens rarely and needs Python.

What differs from the declarations is refused when the class is made. A kernel gets of each signal the
fields that it, or a kernel it calls, reads by name.
"""

from __future__ import annotations

import inspect
import linecache
from collections.abc import Callable, Collection, Mapping
from functools import cache, partial
from types import CodeType, FunctionType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.arguments import record_type
from ...mathematics.compiling.fingerprint import closure
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.compiling.kernel_registry import (
    arguments_of,
    is_kernel,
    reports_event,
    written_code,
)
from ...mathematics.compiling.kinds import NUMBER, ArrayKind, Kind, RecordKind, kind_of_annotation
from ...mathematics.kernel import kernel
from .errors import BlockError, DeclarationError
from .parameters import Parameters, parameter_kinds
from .signals import Signal

Block = Any
"""A ``Block``, whose module imports this one."""

METHODS = ("step", "emit", "update")
_OWN: Mapping[str, str] = {"params": "Params", "constants": "Constants", "scratch": "Scratch"}
"""Arguments that are declared by a class inside the block's."""
_CLOCK = RecordKind("Clock", {"tick": ArrayKind((), int), "base_period": NUMBER})


def declare_steps(cls: type[Any]) -> None:
    """Take over the steps of a new class of blocks that name what they take.

    Raises:
        DeclarationError: an argument is not declared, or with another type.
    """
    own, overridden = dict(cls.named_steps), set(cls.overridden_steps)
    for name in METHODS:
        value = vars(cls).get(name)
        function = value.__func__ if isinstance(value, staticmethod) else value
        if type(function).__module__.startswith("numba."):
            function = kernel_of_numba(cls, name, function)
        if not isinstance(function, FunctionType) or hasattr(function, "binds"):
            continue
        names = arguments_of(function)
        if name in own:
            overridden.add(name)  # a step in Python, which may call that of its base
        if is_kernel(function) or isinstance(value, staticmethod) or "self" not in names[:1]:
            declare(cls, function)
            own[name] = function
            overridden.discard(name)
            place = value.py_func.__code__ if hasattr(value, "py_func") else written_code(function)
            made = step_in_file_of(cls, name, place)
            made.__doc__, made.binds = function.__doc__, function
            setattr(cls, name, made)
    cls.named_steps, cls.overridden_steps = own, frozenset(overridden)


def kernel_of_numba(cls: type[Any], name: str, function: Any) -> FunctionType:
    """Make a kernel that calls a function of ``@numba.njit``, which is a step of a class itself."""
    plain = function.py_func
    names = ", ".join(plain.__code__.co_varnames[: plain.__code__.co_argcount])
    text = f"def {name}({names}):\n    function({names})\n"
    file = f"<{cls.__module__}.{cls.__qualname__}.{name}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    scope = {**plain.__globals__, "function": function}
    exec(compile(text, file, "exec"), scope)  # noqa: S102  # of the text above
    made: FunctionType = scope[name]
    made.__module__, made.__qualname__ = cls.__module__, f"{cls.__qualname__}.{name}"
    made.__doc__, made.__annotations__ = plain.__doc__, dict(plain.__annotations__)
    return kernel(made)


def declare(cls: type[Any], function: FunctionType) -> None:
    """Check what a function of a class takes against the class's declarations, and note its kinds.

    Raises:
        DeclarationError: an argument is not declared, or with another type.
    """
    function.declared_kinds = {n: _declared(cls, function, n) for n in arguments_of(function)}  # type: ignore[attr-defined]


def _declared(cls: type[Any], function: FunctionType, name: str) -> Kind:
    """Return the kind of an argument by the declarations of the class."""
    annotation = function.__annotations__.get(name)
    port = {**cls.inputs, **cls.outputs, **cls.states}.get(name)
    declared: Any = port.signal if port is not None else getattr(cls, _OWN.get(name, ""), None)
    if declared is not None:
        if not _names_type(annotation, declared, cls, function):
            text = f"{cls.__name__}.{function.__name__} takes {name}: {_shown(annotation)} (line "
            text += f"{written_code(function).co_firstlineno}), but "
            kind = type(port).__name__ if port is not None else "class"
            text += (
                f"{cls.__name__}.{name} is {kind}({declared.__name__}) (line {_line_of(cls, name)})"
            )
            raise DeclarationError(f"{text}; write {name}: {declared.__name__}")
        if issubclass(declared, Signal):
            return RecordKind(declared.__name__, declared.kernel_kinds())
        return RecordKind(declared.__name__, parameter_kinds(declared))
    if name == "clock":
        return _CLOCK
    if name == "period":
        return NUMBER
    if name in _OWN:
        raise DeclarationError(
            f"{cls.__name__}.{function.__name__} takes {name}, but {cls.__name__} has no class {_OWN[name]}"
        )
    if annotation is None:
        known = [*cls.inputs, *cls.outputs, *cls.states, "params", "constants", "scratch", "clock"]
        raise DeclarationError(
            f"{cls.__name__}.{function.__name__} (line {written_code(function).co_firstlineno}) takes "
            f"{name!r}, which is no port or state of it; there is {', '.join(known)}. What setup() "
            f"stores in self.{name} needs an annotation"
        )
    return kind_of_annotation(annotation, {**function.__globals__, **vars(cls)})


def _names_type(annotation: Any, declared: type, cls: type, function: FunctionType) -> bool:
    """Return whether an annotation names the declared type, or one of its bases."""
    if annotation is None or annotation is declared:
        return True
    if isinstance(annotation, str):
        if annotation.rpartition(".")[2] == declared.__name__:
            return True
        try:
            annotation = eval(annotation, {**function.__globals__, **vars(cls)})
        except Exception:  # noqa: BLE001  # a name that only type checkers see
            return False
    return isinstance(annotation, type) and issubclass(declared, annotation)


def _shown(annotation: Any) -> str:
    return (
        annotation
        if isinstance(annotation, str)
        else getattr(annotation, "__name__", str(annotation))
    )


def _line_of(cls: type, name: str) -> int | str:
    """Return the line on which a class declares a name."""
    try:
        lines, first = inspect.getsourcelines(cls)
    except (OSError, TypeError):
        return "?"
    for k, line in enumerate(lines):
        if line.strip().startswith((f"{name} =", f"{name}:", f"class {_OWN.get(name, name)}(")):
            return first + k
    return first


def step_in_file_of(cls: type, name: str, place: CodeType) -> Any:
    """Make a method that makes a block's calls; stacks and reports of errors show the given
    place."""
    method = _update if name == "update" else _step
    code = method.__code__.replace(
        co_filename=place.co_filename, co_firstlineno=place.co_firstlineno, co_name=name
    )
    made = FunctionType(code, method.__globals__, name)
    made.__qualname__, made.__module__ = f"{cls.__qualname__}.{name}", cls.__module__
    made.binds = None  # type: ignore[attr-defined]  # marks what declare_steps has made
    return made


def _step(self: Block) -> None:
    for call in self.kernel_calls:
        call.take_turn()
    if self.event is not None and self.event[0]:
        self.on_event()


def _update(self: Block) -> None:
    for call in self.update_calls:
        call.take_turn()


class PythonCall:
    """The call of a step in plain Python that names what it takes."""

    compiled: None = None

    def __init__(self, function: Callable[..., object], arguments: tuple[Any, ...]) -> None:
        self.run = partial(function, *arguments)
        self.when: NDArray[np.int64] | None = None

    @property
    def addresses(self) -> tuple[int, int]:
        """There is no machine code. Raises ``ValueError``."""
        raise ValueError("a step in plain Python has no machine code")

    def take_turn(self) -> None:
        """Perform the call, unless ``when`` leaves it out."""
        if self.when is None or self.when[0]:
            self.run()


def bind_steps(block: Block) -> None:
    """Give a block the calls of its named steps; its ports and what ``setup`` makes are there.

    Raises:
        BlockError: something that a step takes is missing or of a type that a kernel cannot take.
    """
    for name, function in type(block).named_steps.items():
        call = call_of(block, function)
        if name == "update":
            block.update_calls = (call,)
        else:
            block.kernel_calls = (call,)


def call_of(block: Block, function: Callable[..., object]) -> KernelCall | PythonCall:
    """Make the call of a function whose arguments name parts of a block.

    Raises:
        BlockError: something that it takes is missing or of a type that a kernel cannot take.
    """
    if not is_kernel(function):
        return PythonCall(
            function, tuple(_python_argument(block, n) for n in arguments_of(function))
        )
    assert isinstance(function, FunctionType)
    used = names_used(function)
    arguments = [_kernel_argument(block, function, each, used) for each in arguments_of(function)]
    if reports_event(function):
        block.event = np.zeros(1, np.int64)
        arguments.append(block.event)
    return KernelCall(function, *arguments)


def signal_call(function: Callable[..., None], *arguments: Any) -> KernelCall:
    """Make the call of a kernel with these arguments, in their order; of signals it gets what it
    reads."""
    used = names_used(function)
    return KernelCall(
        function,
        *(as_record(each, used) if isinstance(each, Signal) else each for each in arguments),
    )


@cache
def names_used(function: FunctionType) -> frozenset[str]:
    """All attributes that a kernel and those that it calls name."""
    names = {n for each in closure(function) for n in written_code(each).co_names}
    for value in (
        each.__globals__.get(n) for each in closure(function) for n in written_code(each).co_names
    ):
        if type(value).__module__.startswith("numba."):
            from ...mathematics.compiling.numba_calls import is_numba, names_read

            names |= names_read(value) if is_numba(value) else set()
    return frozenset(names)


def _python_argument(block: Block, name: str) -> Any:
    return block.context.clock if name == "clock" else getattr(block, name)


def _kernel_argument(block: Block, function: FunctionType, name: str, used: frozenset[str]) -> Any:
    if name == "clock":
        clock = block.context.clock
        return record_type("Clock", ("tick", "base_period"))(
            clock.present.reshape(()), clock.base_period
        )
    if name == "params":
        return parameter_record(block, used)
    try:
        value = getattr(block, name)
    except AttributeError:
        raise BlockError(
            f"{type(block).__name__}.{function.__name__} takes {name!r}, which is no port or state, "
            "and setup() has stored nothing under that name"
        ) from None
    return as_record(value, used) if isinstance(value, Signal) else value


def as_record(signal: Signal, used: frozenset[str] | None = None) -> Any:
    """Return the named tuple of those fields of a signal that kernels name; by default of all."""
    views = signal.views()
    names = tuple(name for name in views if used is None or name in used) or tuple(views)[:1]
    return record_type(type(signal).__name__, names)(*(views[name] for name in names))


# Parameters


def parameter_record(block: Block, used: Collection[str]) -> Any:
    """Arrays with the parameters that kernels name; a live change writes into them."""
    kinds = parameter_kinds(type(block.params))  # type: ignore[arg-type]  # a class is hashable; mypy asks its instances
    arrays = block.parameter_arrays
    names = tuple(name for name in kinds if name in used)
    for name in names:
        if name not in arrays:  # else another call of the block reads it, too
            arrays[name] = _parameter_array(block.params, name, kinds[name])
    return record_type("Params", names)(*(arrays[name] for name in names))


def _parameter_array(params: Parameters, name: str, kind: Kind) -> NDArray[Any]:
    assert isinstance(kind, ArrayKind)
    value = getattr(params, name)
    if kind.words:
        return np.array(kind.words.index(value), np.int64)
    array: NDArray[Any] = np.array(
        value, {int: np.int64, bool: np.bool_, float: np.float64}[kind.element]
    )
    if array.ndim < kind.rank:  # one number for all elements of a vector
        return np.full(getattr(params, "n"), value, array.dtype)  # noqa: B009  declared by subclasses
    return array


def refresh_parameters(block: Block) -> None:
    """Write a block's present parameters where its kernels read them."""
    if not block.parameter_arrays:
        return
    kinds = parameter_kinds(type(block.params))  # type: ignore[arg-type]  # a class is hashable; mypy asks its instances
    for name, array in block.parameter_arrays.items():
        array[...] = _parameter_array(block.params, name, kinds[name])
