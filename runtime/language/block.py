"""Blocks compute. A block declares its ports, state and parameters; the runtime binds them.

A block is one of two kinds of machine:

* ``step()``: outputs follow from inputs in the same tick (a Mealy machine). It reads inputs,
  writes outputs and may change its state.
* ``emit()`` and ``update()``: outputs follow from state alone (a Moore machine). ``emit`` writes
  outputs before any other block of the tick runs; ``update`` reads inputs after all have run.
  Robots, delays and integrators are of this kind. Every loop of wires needs one of them.

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

from collections.abc import Mapping
from typing import ClassVar, Literal

from ...robots.description import RobotDescription
from .context import Clock as Clock  # noqa: PLC0414  what a block needs is imported from here
from .context import Context as Context  # noqa: PLC0414
from .errors import BlockError
from .parameters import Parameters
from .ports import Input as Input  # noqa: PLC0414
from .ports import Output as Output  # noqa: PLC0414
from .ports import Port as Port  # noqa: PLC0414
from .ports import State as State  # noqa: PLC0414
from .runtime_block import BlockHooks
from .runtime_block import UnmetRequirement as UnmetRequirement  # noqa: PLC0414

STOP_CYCLES = 5
"""Rounds of ``stop_cycle``: more than one, since a bus may lose a packet."""
Metric = float | int | bool | str
"""The type of one named result of a run."""
Need = Literal["robot", "floating base", "feet", "imu", "switches"]
"""Property that a block may need of the graph's robot."""


class Block(BlockHooks):
    """The base of all blocks; the module's docstring shows how to write one.

    The runtime constructs the block with its parameters and context, binds its ports and state as
    attributes and calls ``setup`` once. When the run begins it calls ``start``, then in every tick
    ``step``, or ``emit`` and ``update``. When the run has ended, for whatever reason, it calls
    ``stop_cycle`` (at least five times) and ``close``.

    A block has ``Params``, ports, ``setup``, its steps, and perhaps ``metrics``. What else it may define is in
    ``BlockHooks``; what the runtime keeps in it, in ``RuntimeBlock``.
    """

    Params: ClassVar[type[Parameters]] = Parameters

    needs: ClassVar[tuple[Need, ...]] = ()
    """Properties that the graph's robot must have for this block; the load report names what is
    missing."""

    @property
    def robot(self) -> RobotDescription:
        """The graph's robot, with its actuator profile in use.

        A block that names anything in ``needs`` is never set up without a robot.

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
        """Ask for the run to end after this tick; of several reasons the first is kept."""
        if self.context.clock.stop_reason is None:
            self.context.clock.stop_reason = reason
            self.context.clock.stopped_by = self.context.path

    def setup(self) -> None:
        """Build models and scratch arrays, once, after the ports are bound."""

    def metrics(self) -> Mapping[str, Metric]:
        """Return the block's results at the end of a run, with units in their names.

        ``success`` (a truth value) and ``reason`` judge the run; ``veto`` is a reason why it is no success,
        for blocks that are no judges.
        """
        return {}
