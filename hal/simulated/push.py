"""Pushes the robot once, for a given time, at a given instant of the jump."""

from __future__ import annotations

import math
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Literal

import numpy as np

from ...blocks.signals import ExternalForce, RobotTruth
from ...runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal


class PushState(Signal):
    """The progress of a push."""

    stood = Field(dtype="bool", text="whether the robot has touched the ground")
    waiting = Field(dtype="int64", text="ticks since the trigger")
    pushed = Field(unit="s", text="how long the push has lasted so far")


class Push(Block):
    """Pushes the robot once: ``force`` for ``duration`` at ``point``, a ``delay`` after a trigger.

    The trigger is the true lift-off (``lift_off``: the beginning of the first tick in which no
    contact point carries load; when one does again before the delay is over, the wait begins anew)
    or the start of the run (``start``). The force is constant in the world's frame:
    ``force * (cos(angle) cos(elevation), sin(angle) cos(elevation), sin(elevation))``, so 0 is
    forward, 90 deg to the left, 180 deg backward. The push lasts a whole number of ticks except
    that the force of the last one is scaled, so that the impulse is ``force * duration`` exactly.
    With a force of zero there is no push. With ``speed_change`` the force is computed so that the
    push changes the speed of the robot's centre of mass by that much; so robots of any mass can be
    given the same push.

    The paper's test is 70 N for 0.01 s, 0.03 s after lift-off; it does not say where. The default
    is the torso's centre of mass, 0.12 m above the whole robot's, so the push also turns it.
    """

    class Params(Parameters):
        force: float = live_parameter(70.0, unit="N", ge=0, text="magnitude; zero: no push")
        speed_change: float | None = live_parameter(
            None, unit="m/s", ge=0, text="speed given to the centre of mass, in place of `force`"
        )
        angle: float = live_parameter(0.0, unit="rad", text="direction, from forward to the left")
        elevation: float = live_parameter(0.0, unit="rad", text="direction, above the horizontal")
        duration: float = live_parameter(0.01, unit="s", gt=0, text="how long it lasts")
        trigger: Literal["lift_off", "start"] = parameter(
            "lift_off", text="what the delay is counted from"
        )
        delay: float = live_parameter(0.03, unit="s", ge=0, text="from the trigger to the push")
        point: str = parameter("torso_com", text="a named point of the robot's description")

    needs = ("robot",)
    params: Params
    truth = Input(RobotTruth, reads_truth=True, text="whether the robot is in the air")
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

    def setup(self) -> None:
        """Find the point and compute the force."""
        self._point = list(self.robot.points).index(self.params.point)
        self.on_parameters()

    def on_parameters(self) -> None:
        """Compute the force from its parameters."""
        params = self.params
        flat, force = math.cos(params.elevation), params.force
        if params.speed_change is not None:
            force = self.robot.total_mass * params.speed_change / params.duration
        direction = [flat * math.cos(params.angle), flat * math.sin(params.angle)]
        self._force = force * np.array([*direction, math.sin(params.elevation)])

    def step(self) -> None:
        """Wait for the trigger, then for the delay, then push."""
        progress, out, period = self.progress, self.push, self.period
        out.point[()] = self._point
        out.force.fill(0.0)
        remaining = self.params.duration - float(progress.pushed)
        if remaining <= 1e-9 * period:
            return
        waited = self._waited() * period
        if progress.pushed > 0.0 or waited >= self.params.delay - 1e-9:
            share = min(1.0, remaining / period)
            np.multiply(self._force, share, out=out.force)
            progress.pushed += share * period

    def _waited(self) -> int:
        """The ticks since the trigger, up to now; negative before the trigger."""
        progress = self.progress
        if self.params.trigger == "start":
            progress.waiting += 1
            return int(progress.waiting) - 1
        if any(self.truth.contact_touched.tolist()):
            progress.stood[()] = True
            progress.waiting[()] = 0
            return -1
        if not progress.stood:
            return -1
        progress.waiting += 1
        return int(progress.waiting)
