"""The block that puts a fault on a wire: every entry of ``faults`` in a graph file becomes one of these."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array, Flags, Indices
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.compiling.ring import Octets, next_entry
from ...mathematics.elementary import sin
from ...mathematics.kernel import kernel
from .block import Block, Input, Metric, Output, State
from .delay import RingPosition, copy_call, octets, ring_signal
from .parameters import Parameters, parameter
from .quantities import InputQuantities, OutputQuantities
from .random_stream import RandomStream, StreamState, normal_call, uniform_call
from .signals import Field, Signal

SignalErrorKind = Literal[
    "stuck", "lost", "delayed", "biased", "drifting", "noisy", "scaled", "flipped", "chirp",
]  # fmt: skip
FOLDER = "faults/"
"""Prefix of the paths of faults."""
HOLDING: tuple[SignalErrorKind, ...] = ("stuck", "lost", "delayed")
"""The kinds that give an earlier value, of any type; those beside ``flipped`` compute with numbers."""
OPTIONS: dict[SignalErrorKind, dict[str, bool]] = {
    "stuck": {"value": False},
    "lost": {"share": False},
    "delayed": {"delay": True},
    "biased": {"value": True},
    "drifting": {"value": True, "time": False},
    "noisy": {"value": True},
    "scaled": {"factor": True},
    "flipped": {"bit": True, "share": False},
    "chirp": {"value": True, "low": True, "high": True, "time": False},
}
"""The parameters that a kind has beside when it is there, and whether it needs them."""


class SignalErrorParameters(Parameters):
    """Kind, size and time of a fault."""

    kind: SignalErrorKind = parameter(text="what goes wrong")
    start: float = parameter(
        0.0, unit="s", ge=0, text="when it begins: after the start of the run, or after its event"
    )
    start_spread: float = parameter(
        0.0, unit="s", ge=0, text="up to so much later, drawn uniformly by the seed"
    )
    duration: float | None = parameter(
        None, unit="s", gt=0, text="for how long; by default to the end"
    )
    value: float | None = parameter(
        None, text="the value that is stuck, the bias, or the root mean square of noise or chirp"
    )
    time: float = parameter(
        1.0,
        unit="s",
        gt=0,
        text="a drift has reached `value` after this time; the period of a chirp",
    )
    factor: float = parameter(1.0, text="what a scaled value is multiplied by")
    delay: float = parameter(0.0, unit="s", ge=0, text="how late a delayed value is")
    share: float = parameter(1.0, gt=0, le=1, text="share of the runs in which a value is lost or flipped")  # fmt: skip
    low: float = parameter(1.0, unit="Hz", gt=0, text="the lowest frequency of a chirp")
    high: float = parameter(10.0, unit="Hz", gt=0, text="the highest frequency of a chirp")
    bit: int = parameter(0, ge=0, le=63, text="the bit that is flipped, from the lowest")
    seed: int = parameter(0, ge=0, text="of the random stream")


class SignalErrorState(Signal):
    """State of a fault: present or not."""

    active = Field(dtype="bool", text="whether it is there in this run")
    age = Field(unit="s", text="since when; zero before")


class SignalErrorMemory(Signal):
    """Progress of a fault."""

    runs = Field(dtype="int64", text="runs since its event, or since the start; -1 before")
    happened = Field(dtype="bool", text="whether its event was")
    began = Field(dtype="int64", text="tick in which it was there first; -1 before")
    filled = Field(dtype="bool", text="whether earlier values are known")


class SignalErrorTiming(NamedTuple):
    """Time of a fault: from ``start`` to ``end`` [s], in a ``share`` of the runs, which take
    ``period`` [s] each. With an ``event`` the time counts from when ``compared`` holds first."""

    start: float
    end: float
    period: float
    share: float
    event: bool


class EventCondition(NamedTuple):
    """The condition of an event: an element of a signal, a sign of ``SIGNS``, and a number."""

    sign: int
    number: float


SIGNS = ("==", "!=", "<", "<=", ">", ">=")
"""The comparisons of which an event may be made."""
CONDITION = re.compile(r"\s*(?P<name>\S+?)\s*(?P<sign>==|!=|<=|>=|<|>)\s*(?P<value>\S+)\s*$")
"""A condition as it is written: ``phase.phase == FLIGHT``."""


@kernel
def notice_event(value: Array, condition: EventCondition, happened: Flags) -> None:
    """Set ``happened`` if the condition holds for a value of any type (1,), now or before."""
    number, wanted = float(value[0]), condition.number
    holds = (
        (condition.sign == 0 and number == wanted)
        or (condition.sign == 1 and number != wanted)
        or (condition.sign == 2 and number < wanted)
        or (condition.sign == 3 and number <= wanted)
        or (condition.sign == 4 and number > wanted)
        or (condition.sign == 5 and number >= wanted)
    )
    happened[0] = happened[0] or holds


@kernel
def time_signal_error(
    timing: SignalErrorTiming, tick: Indices, happened: Flags, draw: Array, runs: Indices, began: Indices,
    active: Flags, age: Array, acts: Flags,
) -> None:  # fmt: skip
    """Decide whether a fault is present, since when, and whether it acts in this run; ``draw`` is
    between 0 and 1."""
    if runs[()] >= 0 or happened[0] or not timing.event:
        runs[()] = runs[()] + 1
    elapsed = timing.period * runs[()]
    there = runs[()] >= 0 and timing.start - 1e-9 <= elapsed < timing.end - 1e-9
    active[()] = there
    if there and began[()] < 0:
        began[()] = tick[0]
    age[()] = elapsed - timing.start if there else 0.0
    acts[0] = there and draw[0] < timing.share


@kernel
def fill_ring(values: Octets, ring: Octets, filled: Flags) -> None:
    """Fill the ring in the first run: the entries (k, n) before it equal the ``values`` (1, n) of
    now."""
    if not filled[()]:
        for entry in range(ring.shape[0]):
            for i in range(ring.shape[1]):
                ring[entry, i] = values[0, i]


@kernel
def mark_filled(filled: Flags) -> None:
    """Earlier values are known from now on."""
    filled[()] = True


@kernel
def hold_elements(
    values: Octets, ring: Octets, oldest: Indices, places: Indices, size: int, acts: Flags,
    keeps: bool, out: Octets,
) -> None:  # fmt: skip
    """Write the oldest entry's elements at ``places``, of ``size`` bytes each, to ``out`` where the fault acts,
    and put the values in its place; an entry that ``keeps`` stays while the fault acts."""
    row = int(oldest[()])
    for k in range(places.shape[0]):
        for i in range(places[k] * size, (places[k] + 1) * size):
            if acts[0]:
                out[0, i] = ring[row, i]
            if not (acts[0] and keeps):
                ring[row, i] = values[0, i]


@kernel
def set_elements(value: float, places: Indices, acts: Flags, out: Array) -> None:
    """Elements that are stuck at a value; ``out`` is of any type."""
    if acts[0]:
        for k in range(places.shape[0]):
            out[places[k]] = value


@kernel
def change_elements(
    factor: float, bias: float, drift: float, noise: float, age: Array, normal: Array,
    places: Indices, acts: Flags, out: Array,
) -> None:  # fmt: skip
    """y = factor u + bias + drift age + noise N(0, 1) for the elements at ``places`` of ``out`` (n,)."""
    if acts[0]:
        added = bias + drift * age[()]
        for k in range(places.shape[0]):
            out[places[k]] = factor * out[places[k]] + added + noise * normal[k]


LINES = 40
"""The most frequencies of a chirp."""


def chirp_lines(low: float, high: float, period: float) -> Array:
    """Return the frequencies of a chirp [Hz]: multiples of 1 / period from low to high, evenly in
    their logarithm."""
    first, last = math.ceil(low * period - 1e-9), math.floor(high * period + 1e-9)
    if last < first:
        return np.zeros(0)
    return np.unique(np.rint(np.geomspace(first, last, LINES))) / period


@kernel
def add_sines(
    amplitude: float, frequency: Array, phase: Array, age: Array, places: Indices, acts: Flags,
    out: Array,
) -> None:  # fmt: skip
    """y = u + amplitude sum_k sin(2 pi frequency_k age + phase_k) for the elements at ``places``."""
    if acts[0]:
        added = 0.0
        for k in range(frequency.shape[0]):
            added = added + sin(2.0 * math.pi * frequency[k] * age[()] + phase[k])
        for k in range(places.shape[0]):
            out[places[k]] = out[places[k]] + amplitude * added


@kernel
def flip_bit(octet: int, mask: int, places: Indices, acts: Flags, out: Octets) -> None:
    """Flip one bit, ``mask`` of one ``octet``, of the elements at ``places`` of ``out`` (n, bytes)."""
    if acts[0]:
        for k in range(places.shape[0]):
            byte = int(out[places[k], octet])
            is_set = (byte // mask) % 2 == 1
            out[places[k], octet] = byte - mask if is_set else byte + mask


class SignalError(Block):
    """Passes a signal on, with a fault on some of its elements while it is there:

    * ``stuck``: at the last value before, or at ``value``;
    * ``lost``: in a ``share`` of the runs the last value that came repeats itself;
    * ``delayed``: the value of ``delay`` before;
    * ``biased`` y = u + value; ``drifting`` y = u + value t / time; ``noisy`` y = u + value N(0, 1); ``scaled``
      y = factor u;
    * ``flipped``: in a ``share`` of the runs a ``bit`` is the other one;
    * ``chirp``: y = u + r(t), a sum of sines of equal amplitude from ``low`` to ``high`` that repeats itself after
      ``time``, with the phases that keep it flat: it sweeps through the frequencies (Schroeder, Synthesis of
      low-peak-factor signals, IEEE Trans. Information Theory, 1970). It is no fault, but what a response is measured with.

    It is there from ``start`` on for ``duration``, counted from the start of the run or from when its event first was.
    Runs are those of the block that writes the signal. Subclasses made by ``signal_error_type`` fix signal and
    elements. It raises no errors: everything is checked at load.
    """

    Params = SignalErrorParameters
    params: SignalErrorParameters
    target: ClassVar[str] = ""
    """Target of the fault, as written in the graph."""
    elements: ClassVar[dict[str, NDArray[np.int64]]] = {}
    """The places that it changes, by field."""
    compared: ClassVar[EventCondition | None] = None
    """The event after which it begins, if there is one."""

    state = Output(SignalErrorState, text="whether it is there")
    memory = State(SignalErrorMemory, text="how far it is")
    ring_position = State(RingPosition, text="place in the ring of earlier values")
    stream = State(StreamState, text="the random stream")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Keep the units: a fault changes values only."""
        fields = cls.outputs["y"].signal.fields
        return {
            f"y.{name}": inputs[f"u.{name}"] for name, field in fields.items() if field.inferred
        }

    def save_state(self) -> None:
        """Keep where the stream is."""
        self._random.save(self.stream)

    def load_state(self) -> None:
        """Take it back."""
        self._random.load(self.stream)

    def setup(self) -> None:
        """Make the calls."""
        params = self.params
        self._random = RandomStream(self, params.seed)
        start = params.start + params.start_spread * float(self._random.generator.random())
        end = np.inf if params.duration is None else start + params.duration
        self.memory.runs, self.memory.began = -1, -1
        places = max(len(each) for each in self.elements.values())
        self._draw, self._normal = np.zeros(1), np.zeros(places)
        self._happened, self._acts = self.memory.happened.reshape(1), np.zeros(1, np.bool_)
        ports: dict[str, Any] = self.__dict__
        source, target = dict(ports["u"].views()), dict(ports["y"].views())
        calls: list[Any] = [copy_call(source[name], target[name]) for name in target]
        if self.compared is not None:
            value = next(iter(dict(ports["trigger"].views()).values())).reshape(1)
            calls.append(KernelCall(notice_event, value, self.compared, self._happened))
        timing = SignalErrorTiming(start, end, self.period, params.share, self.compared is not None)
        if params.share < 1.0:
            calls.append(uniform_call(self._random.generator, self._draw)[0])
        calls.append(
            KernelCall(
                time_signal_error,
                timing,
                self.context.clock.present,
                self._happened,
                self._draw,
                self.memory.runs,
                self.memory.began,
                self.state.active,
                self.state.age,
                self._acts,
            )
        )
        if params.kind == "noisy":
            calls.append(normal_call(self._random.generator, self._normal))
        for name, places_of in self.elements.items():
            calls += self._changes(name, places_of, source[name], target[name])
        if "past" in self.states:
            length = next(iter(dict(ports["past"].views()).values())).shape[0]
            calls += [
                KernelCall(mark_filled, self.memory.filled),
                KernelCall(next_entry, self.ring_position.oldest, length),
            ]
        self.kernel_calls = calls

    def _changes(
        self, name: str, places: NDArray[np.int64], source: NDArray[Any], target: NDArray[Any]
    ) -> list[KernelCall]:
        """Return the calls that change one field."""
        params, kind, size = self.params, self.params.kind, target.dtype.itemsize
        out, value = target.reshape(-1), 0.0 if params.value is None else params.value
        if "past" in self.states:
            past = dict(self.__dict__["past"].views())[name]
            ring, values = octets(past, len(past)), octets(source, 1)
            return [
                KernelCall(fill_ring, values, ring, self.memory.filled),
                KernelCall(
                    hold_elements, values, ring, self.ring_position.oldest, places, size,
                    self._acts, kind != "delayed", octets(target, 1),
                ),
            ]  # fmt: skip
        if kind == "stuck":
            return [KernelCall(set_elements, value, places, self._acts, out)]
        if kind == "flipped":
            octet, mask = params.bit // 8, 1 << params.bit % 8
            return [
                KernelCall(flip_bit, octet, mask, places, self._acts, octets(target, target.size))
            ]
        if kind == "chirp":
            lines = chirp_lines(params.low, params.high, params.time)
            share = np.arange(len(lines)) / len(lines)
            return [
                KernelCall(
                    add_sines, value * math.sqrt(2.0 / len(lines)), lines,
                    np.mod(-math.pi * len(lines) * share * share, 2.0 * math.pi), self.state.age,
                    places, self._acts, out,
                )
            ]  # fmt: skip
        change = {
            "biased": (1.0, value, 0.0, 0.0),
            "drifting": (1.0, 0.0, value / params.time, 0.0),
            "noisy": (1.0, 0.0, 0.0, value),
            "scaled": (params.factor, 0.0, 0.0, 0.0),
        }[kind]
        return [
            KernelCall(
                change_elements, *change, self.state.age, self._normal, places, self._acts, out
            )
        ]

    def metrics(self) -> Mapping[str, Metric]:
        """Return the time at which the fault first appeared, if it did."""
        began = int(self.memory.began)
        return {} if began < 0 else {"fault_time_s": began * self.context.clock.base_period}

    def step(self) -> None:
        """Copy, and change what is at fault."""
        for call in self.kernel_calls:
            call.run()


def signal_error_type(
    signal: type[Signal],
    target: str,
    elements: dict[str, NDArray[np.int64]],
    params: SignalErrorParameters,
    delay: int,
    compared: EventCondition | None = None,
    event: type[Signal] | None = None,
    *,
    reads_truth: bool = False,
) -> type[SignalError]:
    """Return the block type that puts a fault on ``signal``: input ``u``, output ``y``.

    Args:
        signal: of the wire.
        target: where it is, as written in the graph.
        elements: the places that change, by field, in row order.
        params: what goes wrong.
        delay: of a delayed value, in runs.
        compared, event: the condition after which it begins, and the signal of one field that is compared.
        reads_truth: whether the event may be one that only a simulator knows.
    """
    body: dict[str, Any] = {
        "__doc__": SignalError.__doc__,
        "target": target,
        "elements": elements,
        "compared": compared,
        "u": Input(signal, text="as it is written"),
        "y": Output(signal, text="as it is read"),
    }
    if params.kind in HOLDING and params.value is None:
        body["past"] = State(ring_signal(signal, delay), text="earlier values")
    if event is not None:
        body["trigger"] = Input(event, text="what begins it", reads_truth=reads_truth)
    return type(f"SignalError{signal.__name__}", (SignalError,), body)
