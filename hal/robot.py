"""The interface between a graph and a robot, simulated or real."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal

from ..blocks.signals import (
    CommandMode,
    ContactSwitches,
    DrivePhase,
    ImuReading,
    JointCommand,
    JointState,
    RobotHealth,
    ThrustCommand,
    ThrusterState,
)
from ..blocks.signals.robot import HEALTHY
from ..mathematics.arrays import Indices1D
from ..mathematics.compiling.kernel_call import KernelCall
from ..mathematics.kernel import kernel
from ..robots.description import RobotDescription
from ..runtime.language.block import STOP_CYCLES, Block, Context, Input, Output, Port
from ..runtime.language.errors import BlockError
from ..runtime.language.parameters import Parameters
from ..runtime.language.signals import Signal
from ..runtime.language.steps import signal_call
from .sensors.sensor import MountedSensor, mounted_sensors
from .sitting import SitDown, SittingPath, sitting_path, stands


@kernel
def report_healthy(tick: Indices1D, base_period: float, health: RobotHealth) -> None:
    """Report healthy drives and sensors in a ``tick``, (1,), of ``base_period`` [s]; nothing is measured."""
    health.state = DrivePhase.DRIVING
    health.condition[:] = HEALTHY
    health.voltage[:] = 0.0
    health.temperature[:] = 0.0
    health.current[:] = 0.0
    health.age[:] = 0.0
    health.imu_age = 0.0
    health.late_cycles = 0
    health.lost_answers = 0
    health.stamp = tick[0] * base_period
    health.joints_valid = True
    health.imu_valid = True
    health.contacts_valid = True


_CLASSES: dict[tuple[Any, ...], type[Block]] = {}
"""Robots with outputs for mounted sensors, or without some, by class, sensors and reasons."""


class Robot(Block, ABC):
    """The base of every block that drives a robot, simulated or real.

    All robots have the same ports, so a graph runs unchanged on any of them, and one output more for
    each sensor that the robot's description mounts on a link (``sensors/``). A robot is a Moore block. In tick ``n`` of the control clock it first publishes the sensors as they were at the
    instant ``t_n`` (``emit``). The controller runs. Then the robot takes the command and its time
    goes on to ``t_{n+1}`` (``update``).

    A driver implements five methods, ``report`` if its drives report their condition, and ``wait`` if it
    has a clock. ``open`` is called once. The others are called by the
    control thread once in every tick, so they must not allocate arrays, must not wait without a
    time-out, and must not raise because a single packet is bad:

    * ``read`` writes the latest sensor sample into ``imu``, ``joints``, ``contacts`` and the outputs of
      mounted sensors.
    * ``report`` writes into ``health`` how the drives and the sensors are. That of ``Robot`` reports
      that all is well, at the tick's own time.
    * ``write`` sends ``command`` to the drives.
    * ``advance`` lets the time to the next tick pass. A simulator computes it. A real robot returns
      at once: its time passes by itself.
    * ``wait`` waits for the next cycle of the robot's own clock, and returns how many were missed. The
      runtime calls it before every tick of a graph whose ``clock`` is ``robot``, and never else. A
      simulator, whose time passes in ``advance``, returns at once: it is what ``Robot`` has.
    * ``damp`` is one stop cycle: it puts all drives into damping, whatever was commanded, and lets
      one period pass. The runtime calls it at least five times at the end of
      every run, also after an exception, a signal or the loss of a machine. It must therefore not
      depend on anything that may have failed.

    The life of a driver: ``setup`` builds models and buffers and touches no hardware. ``open``
    connects, verifies identities, voltages and limits, brings the drives into a safe holding state
    and returns when the first sensor sample is there. Then come the ticks, then the ``damp``
    cycles, then ``close``, which disables the drives and frees the link. ``close`` may be called
    although ``open`` has failed or was never called.

    A robot whose description has no IMU, or no contact switches, publishes zeros at
    that port; a wire from there is an error at load.

    Errors: ``open`` raises what the link raises, with the name of the device. When the link is lost
    during a run, the driver reports it by ``request_stop`` after its time-out.
    """

    _stops = 0
    _path: SittingPath | None = None
    _way_down: SitDown | None = None

    outside: ClassVar[Literal["no", "simulated", "real"]] = "real"

    imu = Output(ImuReading, text="inertial measurement unit, at the start of the tick")
    joints = Output(JointState, text="joint encoders and motor currents, at the same instant")
    contacts = Output(ContactSwitches, text="tactile switches, at the same instant")
    health = Output(RobotHealth, text="voltages, temperatures, currents, conditions and ages")
    command = Input(JointCommand, text="command to the drives")

    @classmethod
    def specialize(
        cls,
        params: Parameters,
        folder: Path,
        robot: RobotDescription | None = None,
        graph_folder: Path | None = None,
    ) -> type[Block]:
        """Make the class with an output for every sensor that the robot's description mounts, and with the reason at
        every output that the robot does not have."""
        sensors = mounted_sensors(robot, folder)
        sensors = () if all(sensor.name in cls.outputs for sensor in sensors) else sensors
        absent = {} if robot is None else cls._absent_outputs(robot)
        thrusters = {} if robot is None or "thrust" in cls.inputs else cls.ports_of_thrusters(robot)
        told = all(cls.outputs[name].absent == why for name, why in absent.items())
        if not sensors and not thrusters and told:
            return cls
        key = (
            cls, *((sensor.name, type(sensor)) for sensor in sensors), *absent.items(), *thrusters
        )  # fmt: skip
        if key not in _CLASSES:
            ports = cls.ports_of(sensors) if sensors else {}
            for name in ports:
                if hasattr(cls, name) or name in thrusters or not name.isidentifier():
                    raise BlockError(
                        f"sensor {name}: the output of a robot cannot be called {name!r}; give it "
                        "another name in the robot's description"
                    )
            for name, reason in absent.items():
                output = cls.outputs[name]
                ports[name] = Output(output.signal, text=output.text, absent=reason)
            body = {"__doc__": cls.__doc__, "__module__": cls.__module__, **thrusters, **ports}
            _CLASSES[key] = type(cls.__name__, (cls,), body)
        return _CLASSES[key]

    @classmethod
    def ports_of(cls, sensors: tuple[MountedSensor, ...]) -> dict[str, Port[Any]]:
        """Return the ports for mounted sensors, by name."""
        return {
            sensor.name: Output(
                sensor.signal,
                text=f"{sensor.kind or 'sensor'} on {sensor.link}, at the same instant",
            )
            for sensor in sensors
        }

    @classmethod
    def ports_of_thrusters(cls, robot: RobotDescription) -> dict[str, Port[Any]]:
        """Return the ports for thrusters, by name; none where it has none, or this driver does not serve them.

        A driver that does serves ``thrust_ports``."""
        return {}

    @staticmethod
    def thrust_ports(robot: RobotDescription) -> dict[str, Port[Any]]:
        """Return the input and the output of a robot with thrusters. Without joints it needs no joint command."""
        if not robot.thrusters:
            return {}
        ports: dict[str, Port[Any]] = {
            "thrust": Input(ThrustCommand, text="command to the thrusters"),
            "thrusters": Output(
                ThrusterState, text="state of the thrusters at the start of the tick"
            ),
        }
        if not robot.joints:
            active = {"mode": int(CommandMode.ACTIVE)}
            text = "whether the thrusters follow, as there are no joints: see CommandMode"
            ports["command"] = Input(JointCommand, default=active, text=text)
        return ports

    def mounted(self) -> dict[str, Signal]:
        """Return the outputs of the mounted sensors, by name."""
        return {name: getattr(self, name) for name in self.robot.sensors.mounted}

    @staticmethod
    def _absent_outputs(robot: RobotDescription) -> Mapping[str, str]:
        """Return the outputs that a robot does not have by its description, each with the reason."""
        absent: dict[str, str] = {}
        if not robot.sensors.imu:
            absent["imu"] = f"{robot.name} has no IMU"
        if not robot.contacts:
            absent["contacts"] = f"{robot.name} has no contact points"
        elif not robot.sensors.switches:
            absent["contacts"] = f"{robot.name} has no contact switches"
        return absent

    @classmethod
    def exported_values(cls, params: Parameters, context: Context) -> Mapping[str, Any]:
        """Export what the graph may compensate: ``delay``, from sensing to torque [s], and ``imu_position``, the
        nominal place of the IMU, from the base's origin [m, base]."""
        return {"delay": cls.nominal_delay(params), "imu_position": [0.0, 0.0, 0.0]}

    @classmethod
    def nominal_delay(cls, params: Parameters) -> float:
        """Return the delay [s] from an instant of the control clock, at which the sensors are read, to the torques that
        are computed from them. A driver that knows its own returns it here."""
        return 0.002

    def emit(self) -> None:
        """Publish the sensors' readings, and how drives and sensors are."""
        self.read()
        self.report()

    def update(self) -> None:
        """Take the command and let the time to the next tick pass."""
        self.write()
        self.advance()

    def start(self) -> None:
        """Open the robot."""
        if self._sitting_speed > 0.0:
            self._path = sitting_path(self.robot)  # at the end there is no time for it
        self.open()

    def wait(self) -> int:
        """Wait for the next cycle of the robot's clock; gives how many were missed."""
        return 0

    def stop_cycle(self) -> None:
        """Put all drives into damping for one cycle. A robot that stands sits down in the cycles before the
        last, if its parameters have a ``sit_down_speed``."""
        self._stops += 1
        if self._stops == 1 and self._path is not None and self._can_sit_down(self._path):
            self.waits_for_others = True  # the way takes as long as it takes, and is no hang
            for _, values in self.command:
                values.flags.writeable = True  # the block that wrote it has run for the last time
            self._way_down = SitDown(
                self.robot, self._path, self._sitting_speed, self.period, self.joints
            )
        way, self._way_down = self._way_down, None  # a call that fails is the last part of the way
        if way is not None and self._stops < STOP_CYCLES and self._go_down(way):
            self._way_down = way
            return
        for _ in range(1 if way is None else STOP_CYCLES):
            self.damp()

    def _go_down(self, way: SitDown) -> bool:
        """Go a part of the way down; return whether the drives have followed."""
        parts = STOP_CYCLES - 1
        for tick in range((self._stops - 1) * way.ticks // parts, self._stops * way.ticks // parts):
            self.read()
            if self.health.state != DrivePhase.DRIVING:
                return False
            way.command(tick + 1, self.command)
            self.write()
            self.advance()
            self.wait()
        return True

    def _can_sit_down(self, path: SittingPath) -> bool:
        """Check whether the robot is to sit down, and stands on driven legs."""
        if len(path.pose) < 2 or self.command.mode != CommandMode.ACTIVE:
            return False
        self.emit()
        driven = self.health.state == DrivePhase.DRIVING
        return driven and stands(self.robot, self.imu, self.joints, self.contacts)

    @property
    def _sitting_speed(self) -> float:
        return float(getattr(self.params, "sit_down_speed", 0.0))

    @abstractmethod
    def open(self) -> None:
        """Connect and come to a safe holding state with a first sensor sample at hand."""

    @abstractmethod
    def read(self) -> None:
        """Write the sensor sample of this tick's start to the outputs."""

    def report(self) -> None:
        """Write how the drives and the sensors are; here that all is well."""
        self._well.run()

    @cached_property
    def _well(self) -> KernelCall:
        return self.report_call()

    def report_call(self) -> KernelCall:
        """Return the call that writes to ``health`` that all is well, at the tick's own time."""
        clock = self.context.clock
        return signal_call(report_healthy, clock.present, clock.base_period, self.health)

    @abstractmethod
    def write(self) -> None:
        """Send the command to the drives."""

    @abstractmethod
    def advance(self) -> None:
        """Let the time to the next tick pass."""

    @abstractmethod
    def damp(self) -> None:
        """One cycle with all drives in damping."""
