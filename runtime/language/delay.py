"""The block that delays a wire: every ``delay: k`` in a graph file becomes one of these."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.compiling.ring import Octets, next_entry, read_entry, write_entry
from .block import Block, Input, Output, State
from .errors import BlockError
from .parameters import Parameters, parameter
from .signals import Field, Signal


class DelayParameters(Parameters):
    """The parameters of every delay."""

    initial: Mapping[str, Any] = parameter(
        {},
        text="the outputs of the first runs, by field: numbers or nested lists; otherwise zero, and the identity of quaternions",
    )


class RingPosition(Signal):
    """The position in a ring buffer."""

    oldest = Field(dtype="int64", text="index of the entry that is emitted next")


class WireDelay(Block):
    """Delays its input by k runs: y[n] = u[n - k]; the first k runs give the initial values.

    Runs are counted at the block's own rate, which for a delayed wire is the rate of the source's
    block. It is a Moore block, so it breaks a loop. It does not interpolate. Subclasses made by
    ``delay_block_type`` fix the signal and k.

    Raises:
        BlockError: an initial value names no field of the signal, or has another shape.
    """

    Params = DelayParameters
    params: DelayParameters
    ring_position = State(RingPosition, text="place in the ring buffer")

    def setup(self) -> None:
        """Fill the ring with the initial values."""
        ports: Mapping[str, Any] = self.__dict__
        source, target, ring = (dict(ports[n].views()) for n in ("u", "y", "past"))
        shapes = {name: view.shape for name, view in target.items()}
        for problem in initial_problems(shapes, self.params.initial):
            raise BlockError(problem)
        for name, value in self.params.initial.items():
            ring[name][...] = value
            target[name][...] = value  # read before the first run of a block with an offset
        oldest = self.ring_position.oldest
        entries = {name: octets(values, len(values)) for name, values in ring.items()}
        self.kernel_calls = [
            KernelCall(read_entry, entries[name], oldest, octets(values, 1))
            for name, values in target.items()
        ]
        length = next(iter(ring.values())).shape[0]
        self.update_calls = [
            *(
                KernelCall(write_entry, entries[name], oldest, octets(values, 1))
                for name, values in source.items()
            ),
            KernelCall(next_entry, oldest, length),
        ]

    def emit(self) -> None:
        """Write the oldest entry."""
        for call in self.kernel_calls:
            call.run()

    def update(self) -> None:
        """Put the input in the place of the oldest entry."""
        for call in self.update_calls:
            call.run()


def octets(values: NDArray[Any], rows: int) -> Octets:
    """Return a view of the bytes of an array in so many rows, so that one kernel serves every
    dtype."""
    return values.reshape(rows, -1).view(np.uint8)


def copy_call(source: NDArray[Any], target: NDArray[Any]) -> KernelCall:
    """Return the call that copies an array to another of the same dtype and size."""
    return KernelCall(read_entry, octets(source, 1), np.zeros((), np.int64), octets(target, 1))


def initial_problems(
    shapes: Mapping[str, tuple[int, ...]], initial: Mapping[str, Any]
) -> list[str]:
    """One text for each mistake in a delay's initial values for fields of the given shapes."""
    problems = []
    for name, value in initial.items():
        if name not in shapes:
            problems.append(f"initial: no field {name!r}; there is {', '.join(shapes)}")
            continue
        try:
            array = np.asarray(value, np.float64)
        except (TypeError, ValueError):
            problems.append(f"initial.{name}: {value!r} is not a number or an array of numbers")
            continue
        if array.shape not in ((), shapes[name]):
            problems.append(
                f"initial.{name} has shape {array.shape}, expected {shapes[name]} or one number"
            )
        elif not np.isfinite(array).all():
            problems.append(f"initial.{name}: {value!r} is not finite")
    return problems


_TYPES: dict[tuple[type[Signal], int], type[WireDelay]] = {}


def delay_block_type(signal: type[Signal], k: int) -> type[WireDelay]:
    """Return the block type that delays ``signal`` by ``k`` >= 1 runs: input ``u``, output
    ``y``."""
    if k < 1:
        raise ValueError(f"a delay is at least 1 run, not {k}")
    if (signal, k) in _TYPES:
        return _TYPES[signal, k]
    past = ring_signal(signal, k)
    kind = type(
        f"WireDelay{signal.__name__}{k}",
        (WireDelay,),
        {
            "__doc__": WireDelay.__doc__,
            "u": Input(signal, text="the signal to delay"),
            "y": Output(signal, text=f"the input {k} runs ago"),
            "past": State(past, text="the last inputs"),
            "delay_runs": k,
        },
    )
    _TYPES[signal, k] = kind
    return kind


def ring_signal(signal: type[Signal], k: int) -> type[Signal]:
    """Return a signal that holds ``k`` values of every field of ``signal``."""
    entries = {
        name: Field(
            (k, *field.shape), dtype=field.dtype_name, frame=field.frame, text=field.text,
            ring="ring_position.oldest", quaternion=field.quaternion,
        )
        for name, field in signal.fields.items()
    }  # fmt: skip
    return type(
        f"Past{signal.__name__}{k}", (Signal,), {"__doc__": "Entries of a ring.", **entries}
    )
