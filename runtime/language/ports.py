"""Ports of a block: the signals that it reads, writes, and keeps from tick to tick."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Generic, Self, TypeVar, overload

from .errors import DeclarationError
from .signals import Signal

S = TypeVar("S", bound=Signal)


class PortOwner:
    """The base of all that has ports: of a class they are declarations, of an instance signals."""


class Port(Generic[S]):
    """The common base of inputs, outputs and states: a signal type and a line of text."""

    def __init__(self, signal: type[S], *, text: str = "") -> None:
        if not (isinstance(signal, type) and issubclass(signal, Signal)):
            raise DeclarationError(f"a port carries a Signal type, not {signal!r}")
        if not signal.fields:
            raise DeclarationError(f"signal {signal.__name__} has no fields")
        self.signal = signal
        self.text = text
        self.name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    # A non-data descriptor: a bound block has the bound signal in its own dictionary, which wins.
    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: PortOwner, owner: type) -> S: ...
    def __get__(self, instance: PortOwner | None, owner: type) -> Self | S:
        if instance is None:
            return self
        raise AttributeError(f"{owner.__name__}.{self.name} is not bound to memory")


class Input(Port[S]):
    """A signal the block reads; its views cannot be written.

    Args:
        signal: the fields the block needs; the source may have further fields.
        default: makes the input optional: while unwired it always reads these values, and zero
            for every field that is not named. Values are numbers or nested lists.
        reads_truth: the block is an observer that may read simulation truth (scoring, recording).
    """

    def __init__(
        self,
        signal: type[S],
        *,
        text: str = "",
        default: Mapping[str, Any] | None = None,
        reads_truth: bool = False,
    ) -> None:
        super().__init__(signal, text=text)
        self.default = default
        self.reads_truth = reads_truth

    @property
    def optional(self) -> bool:
        """True if the input may stay unwired."""
        return self.default is not None


class Output(Port[S]):
    """A signal the block writes.

    Args:
        truth: only a simulator knows this signal. A controller that reads it would not work on a
            robot, so a wire from this output needs ``allow: truth`` in the graph.
        absent: why the block cannot have this output with its robot, such as ``go2 has no IMU``; see
            ``BlockHooks.specialize``. It holds zeros, and a wire from it is reported at load.
    """

    def __init__(
        self, signal: type[S], *, text: str = "", truth: bool = False, absent: str = ""
    ) -> None:
        super().__init__(signal, text=text)
        self.truth = truth
        self.absent = absent


class State(Port[S]):
    """Values that the block keeps from tick to tick, stored in the graph's state buffer."""
