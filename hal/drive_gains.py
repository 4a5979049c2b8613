"""The gains that run in the drives of a robot, real or simulated."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np

from ..mathematics.arrays import Array
from ..mathematics.linear_algebra import product
from ..robots.robot_description import RobotDescription
from ..robots.transmission import MotorGains, motor_gains
from ..runtime.language.block import Misfit
from ..runtime.language.parameters import Parameters, parameter
from ..runtime.language.per_joint import PerJoint

_REACH = 3.0
"""How far from its target a joint is [rad] where the default stiffness asks for the peak torque.
BRUCE's joints get 3.5 N m/rad, as in its maker's own program; stiffer drives hinder a thrust, since
their goals are as old as a period of the bus."""
_DAMPING_TIME = 0.025
"""The default damping as a time of the stiffness [s]."""


class DriveGains(Parameters):
    """The gains of the joints that the drives' own loops are set for."""

    stiffness: PerJoint | None = parameter(
        None, unit="N m/rad", ge=0.0,
        text="joint stiffness that runs in the drives; none: the motors' peak torque at 3 rad",
    )  # fmt: skip
    damping: PerJoint | None = parameter(
        None, unit="N m s/rad", ge=0.0,
        text="joint damping that runs in the drives; none: the stiffness times 0.025 s",
    )  # fmt: skip
    gains: Literal["exact", "nearest"] = parameter(
        "exact",
        text="if no motor gains give these joints' gains: refuse them, or take the nearest and let "
        "the driver add what is lost at the rate of the bus",
    )


def joint_gains(params: DriveGains, robot: RobotDescription) -> tuple[Array, Array]:
    """The joints' gains that are to run in the drives [N m/rad, N m s/rad], each (n_joints,)."""
    peak = product(np.abs(robot.joint_to_motor).T, robot.motors.peak_torque)
    default = motor_gains(robot, peak / _REACH, "N m/rad")
    own = np.diag(default.joint).copy()
    stiffness = own if params.stiffness is None else params.stiffness.resolve(robot)
    damping = _DAMPING_TIME * stiffness
    if params.damping is not None:
        damping = params.damping.resolve(robot)
    return stiffness, damping


def gain_misfits(params: DriveGains, robot: RobotDescription) -> Iterator[Misfit]:
    """Report gains that no drives can give the joints, unless the nearest ones are asked for."""
    if params.gains == "nearest":
        return
    for name, given, gains in zip(
        ("stiffness", "damping"), (params.stiffness, params.damping),
        joint_gains(params, robot), strict=True,
    ):  # fmt: skip
        if given is None:
            continue
        found = motor_gains(robot, gains, "N m/rad" if name == "stiffness" else "N m s/rad")
        if not found.exact:
            yield Misfit(
                f"no motor gains give {robot.name}'s joints this {name}, because motors share "
                f"joints; with the nearest ones {_some(found)}",
                parameter=name,
                expected="gains with joint_to_motor^-T diag(gains) joint_to_motor^-1 diagonal",
                fix="gains: nearest",
            )


def lost_gains(params: DriveGains, robot: RobotDescription) -> dict[str, str]:
    """What the drives do not give of the gains that the graph names, as a metric; empty if nothing."""
    found = [
        text
        for given, gains, unit in zip(
            (params.stiffness, params.damping), joint_gains(params, robot), ("N m/rad", "N m s/rad"),
            strict=True,
        )
        if given is not None
        for text in motor_gains(robot, gains, unit).losses
    ]  # fmt: skip
    return {"lost_drive_gains": "; ".join(found)} if found else {}


def _some(gains: MotorGains, limit: int = 4) -> str:
    text = ", ".join(gains.losses[:limit])
    more = len(gains.losses) - limit
    return f"{text} and {more} more" if more > 0 else text
