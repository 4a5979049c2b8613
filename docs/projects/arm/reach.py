"""A joint motion from where the arm is to a target."""

from collections.abc import Iterable, Mapping

import numpy as np

from aloft import Block, Field, Input, Output, Parameters, Signal, State, live_parameter, parameter
from aloft.blocks.signals import CommandMode, JointCommand, JointState, JointTorque
from aloft.runtime.language.block import Context, UnmetRequirement


class Departure(Signal):
    """The state in which the motion began."""

    position = Field("n_joints", unit="rad", text="joint angles in the first tick")
    time = Field(unit="s", text="time since then")


class Reach(Block):
    """Moves all joints to ``target`` at once, smoothly, and holds them there.

    Within ``duration`` every joint follows the polynomial of degree five that begins and ends at
    rest: q = q0 + (target - q0) (10 s^3 - 15 s^4 + 6 s^5) with s = time / duration. The drives get
    this as joint targets with the two gains, and the torque against gravity as feedforward.

    It does not avoid collisions, and joint limits only as far as both ends are inside them.
    """

    class Params(Parameters):
        target: list[float] = parameter(unit="rad", text="joint angles at the end")
        duration: float = parameter(1.0, unit="s", gt=0, text="how long the motion takes")
        stiffness: float = live_parameter(80.0, unit="N m/rad", ge=0, text="gain on position")
        damping: float = live_parameter(4.0, unit="N m s/rad", ge=0, text="gain on velocity")

    needs = ("robot",)
    params: Params
    joints = Input(JointState, text="measured joints")
    gravity = Input(JointTorque, text="torque that holds the arm up")
    command = Output(JointCommand, text="what the drives are to do")
    departure = State(Departure, text="where the motion began")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Require one target for every joint, inside its limits."""
        robot = context.robot
        count = len(robot.joints)
        if len(params.target) != count:
            found = f"{len(params.target)} angles"
            yield UnmetRequirement(
                f"{robot.name} has {count} joints", "target", f"{count} angles", found
            )
            return
        for joint, angle in zip(robot.joints, params.target, strict=True):
            low, high = joint.limits or (-np.inf, np.inf)
            if not low <= angle <= high:
                bounds = f"{low:g} to {high:g} rad"
                yield UnmetRequirement(
                    f"{joint.name} cannot go there", "target", bounds, f"{angle:g} rad"
                )

    @classmethod
    def example_parameters(cls) -> Mapping:
        """Return an example for the conformance suite."""
        return {"target": [0.1, 0.1, 0.1, 0.1], "duration": 0.01}

    def setup(self) -> None:
        """Make room for the way to go."""
        self._target = np.array(self.params.target)
        self._way = np.zeros(len(self._target))

    def step(self) -> None:
        """Command the point of the motion for the present time."""
        departure, command = self.departure, self.command
        if departure.time == 0.0:
            departure.position[:] = self.joints.position
        s = min(1.0, float(departure.time) / self.params.duration)
        np.subtract(self._target, departure.position, out=self._way)
        np.multiply(self._way, s**3 * (10 - 15 * s + 6 * s**2), out=command.position)
        command.position += departure.position
        rate = 30 * s**2 * (1 - s) ** 2 / self.params.duration
        np.multiply(self._way, rate, out=command.velocity)
        command.torque[:] = self.gravity.torque
        command.stiffness.fill(self.params.stiffness)
        command.damping.fill(self.params.damping)
        command.mode[()] = CommandMode.ACTIVE
        departure.time += self.period

    def metrics(self) -> Mapping:
        """Report the worst joint's distance from its target, as measured."""
        return {"target_error_rad": float(np.abs(self.joints.position - self._target).max())}
