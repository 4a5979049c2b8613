"""Types of a kernel's arguments: arrays by number of dimensions, numbers, and records of these."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from enum import IntEnum
from functools import cache
from types import CodeType
from typing import Any, NamedTuple

from ..arrays import Rank
from .kernel_registry import arguments_of


class RuntimeSize(int):
    """A size that the declarations leave open, as one call has it."""


class GreatestLength(int):
    """The length of a slice whose end may lie beyond its array, where it is shorter."""


class ArrayKind(NamedTuple):
    """An array: the size of each dimension where it is known, and the type of an element.

    A parameter that is one of some ``words`` is kept as the place of its word among them.
    """

    shape: tuple[int | None, ...]
    element: type = float
    words: tuple[str, ...] = ()

    @property
    def rank(self) -> int:
        """The number of dimensions."""
        return len(self.shape)


class RecordKind(NamedTuple):
    """Something with named parts: a signal, parameters, or a named tuple."""

    name: str
    parts: Mapping[str, Kind]


class NumberKind(NamedTuple):
    """A number."""


Kind = ArrayKind | RecordKind | NumberKind | None
"""Kind of an expression; ``None`` where it is not known."""
NUMBER = NumberKind()


def kind_of_annotation(annotation: Any, scope: Mapping[str, Any]) -> Kind:
    """Read the kind in an annotation, or in the text of one; ``scope`` has the names in it."""
    annotation = getattr(annotation, "__forward_arg__", annotation)  # the text in a named tuple
    if isinstance(annotation, str):
        try:
            # Not in a copy of the scope, which takes longer than the rest: a module's has all it needs.
            whole = scope if isinstance(scope, dict) and "__builtins__" in scope else dict(scope)
            annotation = eval(_compiled(annotation), whole)
        except Exception:  # noqa: BLE001  # a name that only type checkers see
            return None
    if annotation in (float, int, bool):
        return NUMBER
    if hasattr(annotation, "kernel_kinds"):
        return _signal_kind(annotation)
    for mark in getattr(annotation, "__metadata__", ()):
        if isinstance(mark, Rank):
            return ArrayKind(mark.sizes or (None,) * mark.dimensions, mark.element)
    if (
        isinstance(annotation, type)
        and issubclass(annotation, tuple)
        and hasattr(annotation, "_fields")
    ):
        scope = vars(sys.modules[annotation.__module__])
        notes = annotation.__annotations__
        parts = {n: kind_of_annotation(notes[n], scope) for n in annotation._fields if n in notes}
        return RecordKind(annotation.__name__, parts)
    if isinstance(annotation, type) and issubclass(annotation, IntEnum):
        return NUMBER
    return None


@cache
def _signal_kind(signal: Any) -> Kind:
    return RecordKind(signal.__name__, signal.kernel_kinds())


@cache
def _compiled(annotation: str) -> CodeType:
    return compile(annotation, "<annotation>", "eval")


@cache
def argument_kinds(function: Any) -> Mapping[str, Kind]:
    """Return the kind of each argument of a kernel, by its annotation or by the block's
    declarations."""
    given: Mapping[str, Kind] = getattr(function, "declared_kinds", {})
    return {
        name: given.get(name) or kind_of_annotation(function.__annotations__.get(name), function.__globals__)
        for name in arguments_of(function)
    }  # fmt: skip
