"""Measures the delay from sensing to torque, and compares it with the graph's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

from ...mathematics.arrays import Array1D
from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Input, Metric, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DelayEstimate, JointCommand, JointState

LAGS = 12
"""Delays up to this many periods less one can be measured."""
_SOLVE_EVERY = 25
"""Ticks between two solutions."""


class DelayMemory(Signal):
    """The state of ``DelayEstimator``."""

    command = Field("n_joints", unit="N m", text="the last command's torques")
    torque = Field("n_joints", unit="N m", text="the last measured torques")
    changes = Field(
        (LAGS, "n_joints"), unit="N m", text="changes of the last commands, newest first"
    )
    square = Field((LAGS, LAGS), text="sum of the products of changes, by their lags")
    product = Field(LAGS, text="sum of the products with the measured changes")
    energy = Field(text="sum of the squares of the measured changes")
    ticks = Field(dtype="int64", text="ticks so far")
    delay = Field(unit="s", text="measured; negative while it is not known")
    matched = Field(unit="", text="share of the measured changes that this delay explains")


class DelayEstimatorParameters(Parameters):
    """The parameters of ``DelayEstimator``."""

    nominal: float = parameter(0.002, unit="s", ge=0.0, le=0.02, text="nominal delay in the graph")
    follow: Literal["measured", "nominal"] = parameter(
        "measured", text="the delay that is the output"
    )
    duration: float = parameter(
        0.6, unit="s", gt=0.0, text="the first part of a run, in which it is measured"
    )
    least_time: float = parameter(
        0.1, unit="s", gt=0.0, text="time after which the measurement may count"
    )
    least_match: float = parameter(
        0.8, gt=0.0, le=1.0, text="share of the torques' changes that it must explain"
    )
    usual: float = parameter(
        0.00075, unit="s", ge=0.0, text="jitter and sampling, which nobody tells"
    )
    tolerated: float = parameter(
        0.002,
        unit="s",
        ge=0.0,
        le=0.02,
        text="the delay that the feedback bears, and that is not predicted",
    )
    tolerance: float = parameter(
        0.001, unit="s", gt=0.0, text="difference of both without a warning"
    )


class DelayConstants(Signal):
    """Times of the delay's measurement, in ticks."""

    first_tick = Field(dtype="int64", text="tick from which on the measurement may count")
    last_tick = Field(dtype="int64", text="tick in which it ends")


class DelayScratch(Signal):
    """Scratch memory of one tick of ``DelayEstimator``."""

    torque_change = Field("n_joints", unit="N m", text="change of the measured torques")


class DelayEstimator(Block):
    """The delay from sensing to torque, which the graph gives once, measured by the torques.

    The command that is computed in tick k, at t_k, takes effect at t_k + d. The measured torques
    are means over the tick before. With d = (j + share) T, T being the period of this block, their
    changes are therefore those of the commands j and j + 1 periods older::

        change(tau)_n = (1 - share) change(u)_{n-1-j} + share change(u)_{n-2-j}

    Over the first ``duration`` of a run j and the share are found by least squares. What the
    sensors' noise does to the commands is enough to tell them. The measurement counts when the
    change of the commands explains at least ``least_match`` of the change of the torques, so only
    while the drives get torques and no joint feedback.

    ``nominal`` is the graph's value: ``{from: robot.delay}`` is that of the robot's driver or
    the simulator. With ``follow: measured`` the output is the measured delay as soon as it counts,
    less ``usual``, by which it is longer than the nominal one where that is right, and at first and
    otherwise the nominal one. With ``follow: nominal`` it is always that. The result of a run has a
    warning where both differ by more than ``tolerance``.

    **Ahead.** Feedback bears a short delay, a long one takes its phase margin. Of a task with the gains
    Kp and Kd the open loop is (Kd s + Kp) exp(-s d) / s^2, so its crossover frequency w and its phase
    margin are::

        w^2 = (Kd^2 + sqrt(Kd^4 + 4 Kp^2)) / 2,    margin = atan(w Kd / Kp) - w d

    The fastest task of BRUCE's controller pulls points without load to the ground (3000 1/s^2, 110 1/s):
    it has 76 degrees without a delay and loses 6.5 with each millisecond. What is longer than
    ``tolerated`` is the output ``ahead``: by so much ``StatePredictor`` predicts the state, the plan is read
    ahead, and ``JumpPhase`` works ahead. The loop then has the phase margin of ``tolerated`` at any
    delay, as far as the model is exact.

    It is a Moore block, so the plan that leads by its output may be what the command follows from.
    """

    Params = DelayEstimatorParameters
    Constants = DelayConstants
    Scratch = DelayScratch
    needs = ("robot",)
    params: DelayEstimatorParameters
    constants: DelayConstants
    command = Input(JointCommand, text="command that was sent to the drives")
    joints = Input(JointState, text="the torques that they report")
    estimate = Output(DelayEstimate, text="the delay to compensate")
    memory = State(DelayMemory, text="sums over the run so far")

    def prepare(self) -> None:
        self.constants.first_tick = round(self.params.least_time / self.period)
        self.constants.last_tick = round(self.params.duration / self.period)

    def start(self) -> None:
        self.memory.delay = -1.0

    @kernel
    @staticmethod
    def emit(
        memory: DelayMemory, estimate: DelayEstimate, params: DelayEstimatorParameters
    ) -> None:
        estimate.measured = max(memory.delay, 0.0)
        estimate.known = memory.delay >= 0.0
        estimate.delay = params.nominal
        if estimate.known and params.follow == "measured":
            estimate.delay = max(memory.delay - params.usual, 0.0)
        estimate.ahead = max(estimate.delay - params.tolerated, 0.0)

    @kernel
    @staticmethod
    def update(
        command: JointCommand,
        joints: JointState,
        memory: DelayMemory,
        params: DelayEstimatorParameters,
        constants: DelayConstants,
        scratch: DelayScratch,
        period: float,
    ) -> None:
        ticks = memory.ticks
        if ticks > constants.last_tick:
            return
        if ticks > LAGS + 1:  # before, some changes are those from nothing to the first command
            scratch.torque_change[:] = joints.torque - memory.torque
            correlate_changes(scratch.torque_change, memory)
        for lag in range(LAGS - 1, 0, -1):
            memory.changes[lag, :] = memory.changes[lag - 1]
        memory.changes[0, :] = command.torque - memory.command
        memory.command[:] = command.torque
        memory.torque[:] = joints.torque
        memory.ticks = ticks + 1
        due = ticks % _SOLVE_EVERY == 0 or ticks == constants.last_tick
        if due and ticks >= constants.first_tick:
            solve_delay(memory, params, period)

    def metrics(self) -> Mapping[str, Metric]:
        """Return the nominal and the measured delay."""
        values: dict[str, Metric] = {"delay_nominal_ms": 1e3 * self.params.nominal}
        if self.memory.delay >= 0.0:
            values["delay_measured_ms"] = 1e3 * float(self.memory.delay)
        return values

    def warnings(self) -> Sequence[str]:
        """Say where the measured delay is not the nominal one."""
        p, measured = self.params, float(self.memory.delay)
        if measured < 0.0 or abs(measured - p.usual - p.nominal) <= p.tolerance:
            return ()
        followed = "is compensated" if p.follow == "measured" else "is not compensated"
        return (
            (
                f"the delay from sensing to torque is {1e3 * measured:.1f} ms as measured, which "
                f"{followed}, and {1e3 * p.nominal:g} ms nominally; correct `nominal` or the robot's delay"
            ),
        )


@kernel
def correlate_changes(torque_change: Array1D, memory: DelayMemory) -> None:
    """Add the products of this tick's changes to the sums."""
    memory.energy += torque_change @ torque_change
    memory.product[:] += memory.changes @ torque_change
    memory.square[:] += memory.changes @ memory.changes.T


@kernel
def solve_delay(memory: DelayMemory, params: DelayEstimatorParameters, period: float) -> None:
    """Find the delay, a number of periods and a share of one, that leaves the least unexplained."""
    energy, square, product = memory.energy, memory.square, memory.product
    if energy <= 0.0:
        return
    least, delay = energy, -1.0
    for j in range(LAGS - 1):
        newer, both, older = square[j, j], square[j, j + 1], square[j + 1, j + 1]
        curvature = newer - 2.0 * both + older
        if curvature <= 0.0:
            continue
        share = (product[j + 1] - product[j] - both + newer) / curvature
        share = min(max(share, 0.0), 1.0)
        rest = 1.0 - share
        error = energy - 2.0 * (rest * product[j] + share * product[j + 1])
        error += rest * rest * newer + 2.0 * share * rest * both
        error += share * share * older
        if error < least:
            least, delay = error, (j + share) * period
    memory.matched = 1.0 - least / energy
    memory.delay = delay if memory.matched >= params.least_match else -1.0
