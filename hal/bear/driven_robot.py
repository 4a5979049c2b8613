"""What a robot on BEAR drives and its twin have in common: ports, parameters, and the cycle."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ...robots.transmission import MotorGains, motor_gains
from ...runtime.language.block import Context, Metric, Misfit
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.per_joint import PerJoint
from ..robot import Robot
from .configuration import Hardware, HardwareError
from .driver import Driver

Array = NDArray[np.float64]

_REACH = 3.0
"""How far from its target a joint is [rad] where the default stiffness asks for the peak torque.
BRUCE's joints get 3.5 N m/rad, as in its maker's own program; stiffer drives hinder a thrust, since
their goals are as old as a period of the bus."""
_DAMPING_TIME = 0.025
"""The default damping as a time of the stiffness [s]."""


class DriveParameters(Parameters):
    """The gains that run in the drives."""

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
    armed: bool = parameter(
        False, text="whether the drives may be switched on; else they are only watched"
    )


class DrivenRobot(Robot):
    """The ports and the life of a robot on BEAR drives; see ``BearRobot`` and ``TwinRobot``."""

    needs = ("robot", "imu", "switches")
    params: DriveParameters

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """Report gains that no drives can give the joints."""
        assert isinstance(params, DriveParameters) and robot is not None
        if params.gains == "nearest":
            return
        for name, given, gains in zip(
            ("stiffness", "damping"), (params.stiffness, params.damping),
            joint_gains(params, robot), strict=True,
        ):  # fmt: skip
            found = motor_gains(robot, gains, "N m/rad" if name == "stiffness" else "N m s/rad")
            if given is not None and not found.exact:
                yield Misfit(
                    f"no motor gains give {robot.name}'s joints this {name}, because motors share "
                    f"joints; with the nearest ones {_some(found)}",
                    parameter=name,
                    expected="gains with joint_to_motor^-T diag(gains) joint_to_motor^-1 diagonal",
                    fix="gains: nearest",
                )

    def setup(self) -> None:
        """Nothing is opened."""
        self.driver: Driver | None = None

    def read(self) -> None:
        """Publish the newest measurements."""
        loop = self._driver.loop
        with loop.lock:
            loop.measured.publish(self.imu, self.joints, self.contacts)
            loop.report(self.health)
            loop.measured.next_tick()

    def report(self) -> None:
        """Nothing more: ``read`` does it, so that the readings and their ages are of one exchange."""

    @abstractmethod
    def now(self) -> float:
        """The time since the driver was opened [s]."""

    def stop_after_fault(self) -> None:
        """Ask for the end of the run if the driver has found a fault."""
        if self._driver.loop.fault:
            self.request_stop(self._driver.loop.fault)

    @property
    def _driver(self) -> Driver:
        assert self.driver is not None, "the robot is not open"
        return self.driver

    def metrics(self) -> Mapping[str, Metric]:
        """What became of the drives; a fault is no success."""
        if self.driver is None:
            return {}
        loop = self.driver.loop
        found: dict[str, Metric] = {
            "drives_at_end": loop.phase.name.lower(),
            "lost_answers": int(loop.lost_answers),
            "bus_cycles": loop.cycles,
        }
        if loop.fault:
            found |= {"success": False, "reason": f"{self.context.path}: {loop.fault}"}
        return found


def joint_gains(params: DriveParameters, robot: RobotDescription) -> tuple[Array, Array]:
    """The joints' gains that are to run in the drives [N m/rad, N m s/rad], each (n_joints,)."""
    peak = np.abs(robot.joint_to_motor).T @ robot.motors.peak_torque
    default = motor_gains(robot, peak / _REACH, "N m/rad")
    own = np.diag(default.joint).copy()
    stiffness = own if params.stiffness is None else params.stiffness.resolve(robot)
    damping = _DAMPING_TIME * stiffness
    if params.damping is not None:
        damping = params.damping.resolve(robot)
    return stiffness, damping


def read_hardware(name: str, context: Context, robot: RobotDescription) -> Hardware:
    """The file of the hardware, relative to the graph's folder.

    Raises:
        HardwareError: there is none, or it has faults.
    """
    places = [context.folder / name, Path(name), context.graph_folder / name]
    file = next((place for place in places if place.is_file()), None)
    if file is None:
        raise HardwareError(
            f"there is no file {name} of the hardware; looked at "
            f"{', '.join(dict.fromkeys(str(place) for place in places))}"
        )
    return Hardware.read(file, robot)


def _some(gains: MotorGains, limit: int = 4) -> str:
    text = ", ".join(gains.losses[:limit])
    more = len(gains.losses) - limit
    return f"{text} and {more} more" if more > 0 else text
