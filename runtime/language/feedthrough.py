"""Finds Moore blocks whose ``emit`` reads an input, by reading their source.

Outputs of a Moore block follow from its state alone: ``emit`` runs before the inputs of the tick
are written, so it would read values of the tick before. The conformance suite finds that by running
the block; this module finds it when a graph is loaded.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from types import FunctionType

from .block import Block

_FOUND: dict[type[Block], tuple[InputRead, ...]] = {}


@dataclass(frozen=True)
class InputRead:
    """An input that ``emit`` reads, and the ``method`` of the block in which it does so."""

    name: str
    method: str
    file: str
    line: int


def inputs_read_by_emit(block_type: type[Block]) -> tuple[InputRead, ...]:
    """Return the inputs that ``emit``, or a method or property it uses, reads as ``self.<input>``.

    Only a direct access is found: not an input that ``setup`` keeps under another name, nor one
    read by a function that takes the block as an argument. The result is empty for a Mealy block,
    and where the source is not available.
    """
    if not block_type.is_moore():
        return ()
    if block_type not in _FOUND:
        _FOUND[block_type] = _look(block_type)
    return _FOUND[block_type]


def _look(block_type: type[Block]) -> tuple[InputRead, ...]:
    """Return the inputs that ``emit`` and all that it uses read, the first place of each."""
    found: dict[str, InputRead] = {}
    seen: set[FunctionType] = set()
    waiting = [*_functions(block_type, "emit")]
    while waiting:
        function = waiting.pop(0)
        if function in seen:
            continue
        seen.add(function)
        names = tuple(_all_names(function))
        if any(name in block_type.inputs for name in names):  # otherwise parsing can be spared
            for name, line in _own_attributes(function):
                if name in block_type.inputs and name not in found:
                    file = function.__code__.co_filename
                    found[name] = InputRead(name, function.__qualname__, file, line)
        for name in names:
            waiting.extend(_functions(block_type, name))
    return tuple(found.values())


def _functions(block_type: type[Block], name: str) -> Iterator[FunctionType]:
    """Yield the functions that ``self.<name>`` may call, with those of base classes for
    ``super()``."""
    for owner in block_type.__mro__:
        if owner is Block or not issubclass(owner, Block):
            continue
        value = vars(owner).get(name)
        value = value.fget if isinstance(value, property) else getattr(value, "__func__", value)
        if isinstance(value, FunctionType):
            yield value
            if "super" not in value.__code__.co_names:
                return


def _all_names(function: FunctionType) -> Iterator[str]:
    """All names in the code of a function and of the functions inside it."""
    waiting = [function.__code__]
    while waiting:
        code = waiting.pop()
        yield from code.co_names
        waiting.extend(inner for inner in code.co_consts if inspect.iscode(inner))


def _own_attributes(function: FunctionType) -> Iterator[tuple[str, int]]:
    """Yield the attributes that a method reads of its first argument, with their lines."""
    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, TypeError, SyntaxError):
        return  # there is no source, as in an interactive session
    if not function.__code__.co_argcount:
        return
    own = function.__code__.co_varnames[0]
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id == own
        ):
            yield node.attr, first + node.lineno - 1
