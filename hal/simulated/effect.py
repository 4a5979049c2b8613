"""Effects: additions to the physics steps of a simulated robot.

``Plant`` has its effects in one list, and each step makes the calls of a hook in the order of that list::

    limit_calls     what the motors can do
                    the drives' torques, and the thrusters'
    torque_calls    from the torques asked of the motors to those that act on the joints
    force_calls     forces on the base, behind a push
                    the physics step
    motion_calls    what sensors make of the motion
                    the record, and the sensors that the description mounts
    model_calls     the model for the next step
                    what follows from the new state
    reading_calls   what drives and boards read of it
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from ...blocks.signals import RobotHealth
from ...mathematics.arrays import Array, Counts, Flags
from ...mathematics.compiling.call_sequence import Call
from .base import FixedBase
from .drives import MotorLimits


class StepViews(NamedTuple):
    """Values that effects read and write in a physics step, in arrays that keep their place.

    Attributes:
        base: the base in the simulator.
        position, velocity: the true joint motion [rad, rad/s], (n_joints,).
        torque: what acts on the joints [N m], (n_joints,).
        angle, speed: what the drives' encoders make of the motion [rad, rad/s], without their offsets.
        turning: at what speed the motors turn, as joints [rad/s], (n_joints,).
        rate, force: what the IMU makes of the base's angular velocity [rad/s] and specific force [m/s^2], (3,).
        closed: the switches that the board sees closed, before they bounce, (n_contacts,).
    """

    base: FixedBase
    position: Array
    velocity: Array
    torque: Array
    angle: Array
    speed: Array
    turning: Array
    rate: Array
    force: Array
    closed: Flags


class Effect:
    """The base of all effects: every hook is empty."""

    def begin(self, position: Array) -> None:
        """Start anew with the joints at rest at ``position`` [rad], (n_joints,)."""

    def seen(self, views: StepViews) -> StepViews:
        """Return the views as later effects, drives and boards have them."""
        return views

    def limit_calls(self, limits: MotorLimits) -> list[Call]:
        """Return the calls that set what the motors can do."""
        return []

    def torque_calls(self, views: StepViews, limits: MotorLimits) -> list[Call]:
        """Return the calls between the torques asked of the motors and ``views.torque``."""
        return []

    def force_calls(self, step: Counts, *, stands: bool) -> list[Call]:
        """Return the calls that add forces on the base in the physics ``step``, a count without a dimension.

        ``stands`` is whether the start is over, and the robot stands by itself.
        """
        return []

    def motion_calls(self, views: StepViews) -> list[Call]:
        """Return the calls that follow the motion of a step, before it is recorded."""
        return []

    def model_calls(self, views: StepViews) -> list[Call]:
        """Return the calls that bring the model up to date for the next step."""
        return []

    def reading_calls(self, views: StepViews) -> list[Call]:
        """Return the calls that read the state after a step."""
        return []

    def restore_calls(self) -> list[Call]:
        """Return the calls that recompute what no snapshot holds."""
        return []

    def health_calls(self, health: RobotHealth) -> list[Call]:
        """Return the calls that write what the drives report."""
        return []

    def metrics(self) -> Mapping[str, float]:
        """Return the drawn values, and extremes of the run."""
        return {}
