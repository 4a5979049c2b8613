"""Blocks: what computes. A block declares its ports, state and parameters; the runtime binds them.

A block is either of two machines:

* ``step()``: outputs follow from inputs in the same tick (a Mealy machine). It reads inputs,
  writes outputs and may change its state.
* ``emit()`` and ``update()``: outputs follow from state alone (a Moore machine). ``emit`` writes
  outputs before any other block of the tick runs; ``update`` reads inputs after all have run.
  Robots, delays and integrators are of this kind, and they are what breaks a loop.

A small one::

    class Gain(Block):
        \"\"\"The input times a constant. ...\"\"\"

        class Params(Parameters):
            gain: float = parameter(1.0, text="the factor")

        params: Params
        u = Input(Scalar, text="what is scaled")
        y = Output(Scalar, text="gain times u")

        def step(self) -> None:
            np.multiply(self.u.value, self.params.gain, out=self.y.value)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Generic, Literal, Self, TypeVar, overload

import numpy as np

from ...robots.description import RobotDescription
from .errors import BlockError, DeclarationError
from .parameters import Parameters
from .signals import Signal
from .terrain import Terrain

S = TypeVar("S", bound=Signal)
Metric = float | int | bool | str
"""The type of one named result of a run."""
Need = Literal["robot", "floating base", "feet", "imu", "switches"]
"""What a block may need of the graph's robot."""


class Port(Generic[S]):
    """What inputs, outputs and states share: a signal type and a line of text."""

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

    # Non-data descriptor: a bound block holds the bound signal in its own dictionary.
    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: Block, owner: type) -> S: ...
    def __get__(self, instance: Block | None, owner: type) -> Self | S:
        if instance is None:
            return self
        raise AttributeError(f"{owner.__name__}.{self.name} is not bound to memory")


class Input(Port[S]):
    """A signal the block reads; its views cannot be written.

    Args:
        signal: the fields the block needs; a source with more fields is fine.
        default: makes the input optional; an unwired one then reads these values for ever, and
            zero for every field not named. Values are numbers or nested lists.
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
        """Whether the input may stay unwired."""
        return self.default is not None


class Output(Port[S]):
    """A signal the block writes.

    Args:
        truth: only a simulator knows this; a controller that reads it would not work on a robot,
            so a wire from here needs the graph's explicit leave.
    """

    def __init__(self, signal: type[S], *, text: str = "", truth: bool = False) -> None:
        super().__init__(signal, text=text)
        self.truth = truth


class State(Port[S]):
    """What the block remembers from tick to tick, kept in the graph's state buffer."""


@dataclass(frozen=True)
class Misfit:
    """Something about the graph's robot or a parameter that a block cannot work with.

    ``message`` says what is wrong. ``parameter`` is the parameter that it is about, if any, as
    ``name`` or ``name.key``; ``nearest`` holds legal names like the one found; ``fix`` is what to
    write instead.
    """

    message: str
    parameter: str = ""
    expected: str = ""
    found: str = ""
    nearest: tuple[str, ...] = ()
    fix: str = ""


@dataclass
class Clock:
    """The time of a run: the present tick, the seconds one takes, and how it is paced (the
    ``kind`` of its ``ClockSpec``)."""

    base_period: float
    tick: int = 0
    stop_reason: str | None = None
    kind: str = "free"
    stopped_by: str = ""
    """The path of the block that asked for the end of the run."""


@dataclass(frozen=True)
class Context:
    """What the runtime tells a block about the graph it is in.

    ``period_ticks`` and ``offset_ticks`` say in which base ticks the block runs; ``dimensions``
    holds every resolved dimension the block can see; ``wired`` names its wired inputs;
    ``folder`` is where the file lies that declares the block, to which files that a parameter names
    are relative; ``graph_folder`` is where the graph lies that was loaded, beside which a user
    keeps modules.
    """

    path: str
    clock: Clock
    period_ticks: int = 1
    offset_ticks: int = 0
    dimensions: Mapping[str, int] = field(default_factory=dict)
    robot: RobotDescription | None = None
    wired: tuple[str, ...] = ()
    folder: Path = Path()
    graph_folder: Path = Path()

    @property
    def period(self) -> float:
        """The seconds between two runs of the block."""
        return self.clock.base_period * self.period_ticks


class Block:
    """The base of all blocks; see the module's text for how to write one.

    Life: the runtime constructs the block with its parameters and context, binds its ports and
    state as attributes, calls ``setup`` once, then ``start`` when the run begins, then the
    machine's methods tick by tick, then ``stop_cycle`` (at least five times, whatever happened)
    and ``close``.
    """

    Params: ClassVar[type[Parameters]] = Parameters
    inputs: ClassVar[Mapping[str, Input[Any]]] = {}
    outputs: ClassVar[Mapping[str, Output[Any]]] = {}
    states: ClassVar[Mapping[str, State[Any]]] = {}

    outside: ClassVar[Literal["no", "simulated", "real"]] = "no"
    """Whether outputs come from outside the graph: from a simulator, which repeats itself, or from
    the real world (a robot, another machine), which does not and is replayed from a recording."""

    array_allocations: ClassVar[int] = 0
    """How many arrays a tick may allocate. Not zero only where a library leaves no choice; the
    class then says which in ``allocation_reason``."""
    allocation_reason: ClassVar[str] = ""

    needs: ClassVar[tuple[Need, ...]] = ()
    """What the graph's robot must have for this block; missing ones are in the load report."""

    params: Parameters
    context: Context

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        ports = {n: v for n, v in vars(cls).items() if isinstance(v, Port)}
        for name, port in ports.items():
            if isinstance(vars(cls).get(name), Port) and name in _RESERVED:
                raise DeclarationError(f"{cls.__name__}: a port cannot be called {name!r}")
            port.name = name
        cls.inputs = {**cls.inputs, **{n: p for n, p in ports.items() if isinstance(p, Input)}}
        cls.outputs = {**cls.outputs, **{n: p for n, p in ports.items() if isinstance(p, Output)}}
        cls.states = {**cls.states, **{n: p for n, p in ports.items() if isinstance(p, State)}}

    def __init__(self, params: Parameters, context: Context) -> None:
        self.params = params
        self.context = context

    @classmethod
    def is_moore(cls) -> bool:
        """Whether outputs follow from state alone (``emit`` and ``update``).

        Raises:
            DeclarationError: the class has neither machine's methods, or some of both.
        """
        step, emit, update = (hasattr(cls, name) for name in ("step", "emit", "update"))
        if step and not emit and not update:
            return False
        if emit and update and not step:
            return True
        raise DeclarationError(
            f"{cls.__name__} must define either step(), or emit() and update(); it defines "
            + (", ".join(n for n in ("step", "emit", "update") if hasattr(cls, n)) or "none")
        )

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Dimensions of this block alone, which hide the graph's of the same name.

        By default every integer parameter is one, so a block with a parameter ``n`` may declare
        fields of shape ``"n"``.
        """
        values = {name: getattr(params, name) for name in type(params).model_fields}
        return {n: v for n, v in values.items() if isinstance(v, int) and not isinstance(v, bool)}

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """What does not fit this block, asked at load; nothing when all is well.

        Called only if the robot has all that ``needs`` names, so a block that needs a robot is
        never asked without one. What is found here is part of the load report.
        """
        return ()

    @classmethod
    def requires_of_graph(cls, params: Parameters, context: Context) -> Iterable[Misfit]:
        """What does not fit the graph the block is in, asked at load together with ``requires``.

        ``context`` is the one the block will be constructed with: it knows the period of the
        block, which of its inputs are wired, and the folder to which files are relative.
        """
        return ()

    @classmethod
    def absent_outputs(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, str]:
        """Outputs that mean nothing with these parameters and this robot, and why each.

        Such an output keeps its place in memory, holds zeros, and must not be wired: a wire from it
        is reported at load with the reason, such as ``go2 has no IMU``. Asked under the same
        conditions as ``requires``.
        """
        return {}

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Further dimensions that only state fields use; may build models, so it runs at bind."""
        return {}

    @classmethod
    def terrain(cls, params: Parameters) -> Terrain | None:
        """The ground that the block knows of with these parameters; recordings draw it."""
        return None

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """What the conformance suite sets on the block, which must at least be what is required."""
        return {}

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """Legal inputs for the conformance suite, by input and field, drawn anew every tick.

        Only for fields where the suite's own are not legal: those are numbers within +-1, unit
        quaternions for an ``orientation``, rotation matrices for a ``rotation``, and members of a
        field's ``values``.
        """
        return {}

    @property
    def robot(self) -> RobotDescription:
        """The graph's robot, with its actuator profile in use.

        A block that declares what it needs of a robot is never set up without one.

        Raises:
            BlockError: the graph has no robot.
        """
        if self.context.robot is None:
            raise BlockError(f"{type(self).__name__} needs a robot, and the graph names none")
        return self.context.robot

    @property
    def tick(self) -> int:
        """The present base tick."""
        return self.context.clock.tick

    @property
    def period(self) -> float:
        """The seconds between two runs of this block."""
        return self.context.period

    @property
    def time(self) -> float:
        """The seconds since the run began, derived from the tick."""
        return self.context.clock.base_period * self.context.clock.tick

    def request_stop(self, reason: str) -> None:
        """Ask for the run to end after this tick; the first reason is the one kept."""
        if self.context.clock.stop_reason is None:
            self.context.clock.stop_reason = reason
            self.context.clock.stopped_by = self.context.path

    def setup(self) -> None:
        """Build models and scratch arrays, once, after the ports are bound."""

    def on_parameters(self) -> None:
        """Take over live parameters that have changed in ``self.params``, between two ticks.

        Recompute what ``setup`` derived from them; ``setup`` may well call this. After it the
        block must go on exactly as one that had these parameters from the start and is in the
        same state, so it writes neither state nor outputs. It runs on the control thread. Should
        it raise, the old parameters come back and the change is refused with the error's text.
        """

    def start(self) -> None:
        """Open what the run needs; called once before the first tick."""

    def stop_cycle(self) -> None:
        """One cycle of coming to rest; a robot commands damping here."""

    def close(self) -> None:
        """Give back what ``start`` opened; called once, also after a failure."""

    def freeze(self) -> None:
        """Write what is remembered outside the declared state into it, before a snapshot."""

    def thaw(self) -> None:
        """Take it back from the declared state, after a restore."""

    def metrics(self) -> Mapping[str, Metric]:
        """The block's results at the end of a run, with units in their names."""
        return {}

    def cautions(self) -> Sequence[str]:
        """What whoever reads a run's results must know of how they came about, such as a check that
        was waived; asked once, when every block has started."""
        return ()


_RESERVED = frozenset(name for name in vars(Block) if not name.startswith("__"))
