"""The common base of a robot on BEAR drives and its twin: ports, parameters, and the cycle."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ...files.problems import Code, Position, Problem, Report, listing
from ...robots.description import RobotDescription
from ...runtime.language.block import Context, Metric, UnmetRequirement
from ...runtime.language.parameters import Parameters, parameter
from ..drive_control import DriveGains, gain_requirements, lost_gains
from ..robot import Robot
from .configuration import Hardware, HardwareError
from .driver import Driver


class DriveParameters(DriveGains):
    """The drives' gains, and whether they may be switched on."""

    armed: bool = parameter(False, text="the drives may be switched on; else they are only watched")
    planned_load: dict[str, float] | None = parameter(
        None,
        text="integral of the squared torque of every motor over the plan [N^2 m^2 s], {from: plan.load}: with "
        "windings that it would overheat nothing is enabled; none: `drives.jump_heating` of the hardware",
    )  # fmt: skip


class DrivenRobot(Robot):
    """The ports and the life of a robot on BEAR drives; see ``BearRobot`` and ``TwinRobot``."""

    needs = ("robot", "imu", "switches")
    params: DriveParameters

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report gains that no drives can give the joints."""
        robot = context.robot
        assert isinstance(params, DriveParameters) and robot is not None
        yield from gain_requirements(params, robot)
        motors = robot.transmission.motors
        missing = [name for name in motors if name not in (params.planned_load or motors)]
        if missing:
            yield UnmetRequirement(
                f"the planned load says nothing of {listing(missing)}", parameter="planned_load",
                expected="a number for every motor", fix="planned_load: {from: plan.load}",
            )  # fmt: skip

    @classmethod
    def exported_values(cls, params: Parameters, context: Context) -> Mapping[str, Any]:
        """Export as any robot does, with the IMU's place from the file of the hardware."""
        values = super().exported_values(params, context)
        name, robot = getattr(params, "hardware", ""), context.robot
        if not name or robot is None:
            return values
        try:
            board = read_hardware(name, context, robot).board
        except HardwareError:  # the load report says so
            return values
        return {**values, "imu_position": list(board.imu_position)}

    def setup(self) -> None:
        """Nothing is opened."""
        self.driver: Driver | None = None

    def read(self) -> None:
        """Publish the newest measurements."""
        loop = self._driver.loop
        with loop.lock:
            loop.measured.publish(self.imu, self.joints, self.contacts)
            loop.goals.correct(self.joints.velocity, self.joints.torque)
            loop.measured.publish_mounted(self.mounted())
            loop.report(self.health)
            loop.measured.next_tick()

    def report(self) -> None:
        """Nothing more: ``read`` does it, so that the readings and their ages are of one exchange."""

    def close(self) -> None:
        """Let the windings cool, and give the ports back."""
        if self.driver is not None:
            self.waits_for_others = True  # no hang: it has a limit of its own, `board.cool_down`
            self.driver.close()

    @abstractmethod
    def now(self) -> float:
        """Return the time since the driver was opened [s]."""

    def stop_after_fault(self) -> None:
        """Ask for the end of the run if the driver has found a fault."""
        if self._driver.loop.fault:
            self.request_stop(self._driver.loop.fault)

    @property
    def _driver(self) -> Driver:
        assert self.driver is not None, "the robot is not open"
        return self.driver

    def metrics(self) -> Mapping[str, Metric]:
        """Return the outcome of the drives; a fault is no success."""
        if self.driver is None:
            return {}
        loop = self.driver.loop
        found: dict[str, Metric] = {
            "drives_at_end": loop.phase.name.lower(),
            "lost_answers": int(loop.lost_answers),
            "bus_cycles": loop.cycles,
            **lost_gains(self.params, self.robot),
        }
        if loop.fault:
            found |= {"success": False, "reason": f"{self.context.path}: {loop.fault}"}
        return found


def read_hardware(name: str, context: Context, robot: RobotDescription) -> Hardware:
    """Read the file of the hardware, relative to the graph's folder.

    Raises:
        HardwareError: there is none, or it has faults.
    """
    places = [context.folder / name, Path(name), context.graph_folder / name]
    file = next((place for place in places if place.is_file()), None)
    if file is None:
        problem = Problem(
            Code.FILE,
            f"there is no file {name} of the hardware",
            Position(name, 0, 0),
            expected=" or ".join(dict.fromkeys(str(place) for place in places)),
        )
        raise HardwareError(Report(name, (problem,)))
    return Hardware.read(file, robot)


def missing_sensors(hardware: Hardware, robot: RobotDescription) -> Iterator[UnmetRequirement]:
    """Report sensors of the description that the board's packets do not carry."""
    for name in robot.sensors.mounted:
        if name not in hardware.board.sensors:
            yield UnmetRequirement(
                f"the packets of the sensor board do not carry {robot.name}'s sensor {name!r}",
                parameter="hardware",
                fix=f"board: {{sensors: [{', '.join(robot.sensors.mounted)}]}} in the hardware's file",
            )
