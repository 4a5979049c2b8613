"""Pushes the robot once, for a given time, at a given instant of the jump."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Literal

import numpy as np

from ...blocks.signals import ExternalForce, RobotTruth
from ...mathematics.elementary import cos, sin
from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal


class PushState(Signal):
    """The progress of a push."""

    stood = Field(dtype="bool", text="the robot has touched the ground")
    waiting = Field(dtype="int64", text="ticks since the trigger")
    flights = Field(dtype="int64", text="flights so far that lasted as long as the delay")
    counted = Field(dtype="bool", text="the present flight is among them")
    pushed = Field(unit="s", text="duration of the push so far")


@kernel
def ticks_since_trigger(at_start: bool, truth: RobotTruth, progress: PushState) -> int:
    """Count the ticks since the trigger, up to now; negative before the trigger."""
    if at_start:
        progress.waiting = progress.waiting + 1
        return int(progress.waiting - 1)
    for point in range(truth.contact_touched.shape[0]):
        if truth.contact_touched[point]:
            progress.stood = True
            progress.waiting = 0
            return -1
    if not progress.stood:
        return -1
    progress.waiting = progress.waiting + 1
    return int(progress.waiting)


class Push(Block):
    """Pushes the robot once: ``force`` for ``duration`` at ``point``, a ``delay`` after a trigger.

    The trigger is the true lift-off (``lift_off``: the beginning of the first tick in which no
    contact point carries load; when one does again before the delay is over, the wait begins anew) of the
    first ``flight``, or of a later one,
    or the start of the run (``start``). The force is constant in the world's frame:
    ``force * (cos(angle) cos(elevation), sin(angle) cos(elevation), sin(elevation))``, so 0 is
    forward, 90 deg to the left, 180 deg backward. The push lasts a whole number of ticks except
    that the force of the last one is scaled, so that the impulse is ``force * duration`` exactly.
    With a force of zero there is no push. With ``speed_change`` the force is computed so that the
    push changes the speed of the robot's centre of mass by that much; so robots of any mass can be
    given the same push.

    The paper's test is 70 N for 0.01 s, 0.03 s after lift-off; it does not give the point. The default
    is the torso's centre of mass, 0.12 m above the whole robot's, so the push also turns it.
    """

    class Params(Parameters):
        force: float = live_parameter(70.0, unit="N", ge=0, text="magnitude; zero: no push")
        speed_change: float | None = live_parameter(
            None, unit="m/s", ge=0, text="speed given to the centre of mass, in place of `force`"
        )
        angle: float = live_parameter(0.0, unit="rad", text="direction, from forward to the left")
        elevation: float = live_parameter(0.0, unit="rad", text="direction, above the horizontal")
        duration: float = live_parameter(0.01, unit="s", gt=0, text="its duration")
        trigger: Literal["lift_off", "start"] = parameter(
            "lift_off", text="event from which the delay is counted"
        )
        flight: int = parameter(1, ge=1, text="in which flight, counted from 1, after a lift-off")
        delay: float = live_parameter(0.03, unit="s", ge=0, text="from the trigger to the push")
        point: str = parameter("torso_com", text="a named point of the robot's description")

    class Constants(Signal):
        force = Field(3, unit="N", frame="world", text="the force while it lasts")
        point = Field(dtype="int64", text="index of the point it acts at")

    needs = ("robot",)
    params: Params
    constants: Constants
    truth = Input(RobotTruth, reads_truth=True, text="true state: the robot is in the air")
    push = Output(ExternalForce, text="the force; it is zero except during the push")
    progress = State(PushState, text="the progress of the push")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a point that the robot does not have."""
        robot = context.robot
        assert isinstance(params, cls.Params) and robot is not None
        if params.point not in robot.points:
            points = list(robot.points)
            near = get_close_matches(params.point, points, 1) or points[:1]
            yield UnmetRequirement(
                f"{robot.name} has no point {params.point!r} to push at",
                parameter="point",
                expected=", ".join(points) or "a robot with named points",
                found=params.point,
                fix=f"point: {near[0]}" if near else "",
            )

    def prepare(self) -> None:
        """Find the point and compute the force."""
        params, constants = self.params, self.constants
        flat, force = cos(params.elevation), params.force
        if params.speed_change is not None:
            force = self.robot.total_mass * params.speed_change / params.duration
        direction = [flat * cos(params.angle), flat * sin(params.angle)]
        constants.force[:] = force * np.array([*direction, sin(params.elevation)])
        constants.point = list(self.robot.points).index(params.point)

    @kernel
    @staticmethod
    def step(
        truth: RobotTruth, push: ExternalForce, progress: PushState, params: Params,
        constants: Constants, period: float,
    ) -> None:  # fmt: skip
        """Wait for the trigger, then for the delay, then push."""
        push.point = constants.point
        push.force[:] = 0.0
        remaining = params.duration - progress.pushed
        if remaining <= 1e-9 * period:
            return
        ticks = ticks_since_trigger(params.trigger == "start", truth, progress)
        due = ticks * period >= params.delay - 1e-9
        if due and not progress.counted:
            progress.flights = progress.flights + 1
        progress.counted = due
        chosen = params.trigger == "start" or progress.flights >= params.flight
        if progress.pushed > 0.0 or (due and chosen):
            share = min(1.0, remaining / period)
            push.force[:] = constants.force * share
            progress.pushed = progress.pushed + share * period
