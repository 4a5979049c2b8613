"""The law that runs in the drives: their gains, and how commands become their goals."""

from __future__ import annotations

from ...mathematics.arrays import Array
from ...robots.robot_description import RobotDescription
from ...robots.transmission import motor_gains
from ..drive_goals import DriveGoals


class DriveLaw:
    """What the drives are set to, and the goals that follow from it.

    A block makes it in ``setup``, before any port is open, so that the kernel of the goals is
    compiled with those of the graph.

    Args:
        robot: the description.
        stiffness, damping: the joints' gains that run in the drives [N m/rad, N m s/rad],
            (n_joints,); where no motor gains give them, the nearest do.
        lead: the time from a measurement to when the goals made from it act [s].

    Attributes:
        motor_stiffness, motor_damping: the gains of every drive at its output [N m/rad, N m s/rad],
            (n_joints,).
        goals: how commands become goals.
    """

    def __init__(
        self, robot: RobotDescription, stiffness: Array, damping: Array, lead: float
    ) -> None:
        self.motor_stiffness = motor_gains(robot, stiffness, "N m/rad").motor
        self.motor_damping = motor_gains(robot, damping, "N m s/rad").motor
        self.goals = DriveGoals(
            robot, stiffness, damping, self.motor_stiffness, self.motor_damping, lead
        )
