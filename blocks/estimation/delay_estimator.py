"""Measures the delay from sensing to torque, and compares it with what the graph says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

from ...mathematics.compiling.kernel_call import KernelCall
from ...runtime.language.block import Block, Input, Metric, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DelayEstimate, JointCommand, JointState
from .delay_sums import LAGS, Memory, follow_delay, give_delay


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


class DelayEstimator(Block):
    """The delay from sensing to torque, which the graph says once, measured by the torques.

    The command that is computed in tick k, at t_k, takes effect at t_k + d. The measured torques
    are means over the tick before. With d = (j + share) T, T being the period of this block, their
    changes are therefore those of the commands j and j + 1 periods older::

        change(tau)_n = (1 - share) change(u)_{n-1-j} + share change(u)_{n-2-j}

    Over the first ``duration`` of a run j and the share are found by least squares. What the
    sensors' noise does to the commands is enough to tell them. The measurement counts when the
    change of the commands explains at least ``least_match`` of the change of the torques, so only
    while the drives get torques and no joint feedback.

    ``told`` is what the graph says: ``{from: robot.delay}`` is what the robot's driver or the
    simulator says. With ``follow: measured`` the output is the measured delay as soon as it counts,
    less ``usual``, by which it is longer than what is told where that is right, and at first and
    otherwise what is told. With ``follow: told`` it is always that. The result of a run has a
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

    class Params(Parameters):
        told: float = parameter(
            0.002, unit="s", ge=0.0, le=0.02, text="the delay that the graph says"
        )
        follow: Literal["measured", "told"] = parameter(
            "measured", text="which of both is the output"
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

    needs = ("robot",)
    params: Params
    command = Input(JointCommand, text="what the drives were sent")
    joints = Input(JointState, text="the torques that they report")
    estimate = Output(DelayEstimate, text="the delay to compensate")
    memory = State(DelayMemory, text="sums over the run so far")

    def setup(self) -> None:
        p, estimate = self.params, self.estimate
        memory = Memory(*(getattr(self.memory, name) for name in Memory._fields))
        self._give = KernelCall(
            give_delay, p.told, p.usual, p.follow == "measured", memory, p.tolerated,
            estimate.measured, estimate.known, estimate.delay, estimate.ahead,
        )  # fmt: skip
        self._follow = KernelCall(
            follow_delay, self.command.torque, self.joints.torque,
            round(p.least_time / self.period), round(p.duration / self.period), p.least_match,
            self.period, memory,
        )  # fmt: skip

    def start(self) -> None:
        self.memory.delay[()] = -1.0

    def emit(self) -> None:
        self._give.run()

    def update(self) -> None:
        self._follow.run()

    def metrics(self) -> Mapping[str, Metric]:
        """What was told and measured."""
        values: dict[str, Metric] = {"delay_told_ms": 1e3 * self.params.told}
        if self.memory.delay >= 0.0:
            values["delay_measured_ms"] = 1e3 * float(self.memory.delay)
        return values

    def warnings(self) -> Sequence[str]:
        """Say where the measured delay is not the one that was told."""
        p, measured = self.params, float(self.memory.delay)
        if measured < 0.0 or abs(measured - p.usual - p.told) <= p.tolerance:
            return ()
        followed = "is compensated" if p.follow == "measured" else "is not compensated"
        return (
            (
                f"the delay from sensing to torque is {1e3 * measured:.1f} ms as measured, which "
                f"{followed}, and {1e3 * p.told:g} ms as told; correct `told` or the robot's delay"
            ),
        )
