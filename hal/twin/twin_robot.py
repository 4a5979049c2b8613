"""The robot's twin in a graph: the real driver, the real bytes, and physics behind them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from ...robots.description import RobotDescription
from ...runtime.language.block import Context, Metric, State, UnmetRequirement
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..bear.configuration import Hardware
from ..bear.driven_robot import DrivenRobot, DriveParameters, missing_sensors, read_hardware
from ..bear.driver import DriveLaw, Driver
from ..bear.motor_loop import CommandQueue
from ..drive_control import joint_gains
from ..simulated.parameters import SimulatorParameters
from ..simulated.plant import Plant
from ..simulated.simulated_robot import (
    SimulatedRobot,
    impossible_effects,
)
from ..simulated.state import DriveState, PhysicsState, TickRecord
from ..simulated.unsupported import uneven_contacts, unsupported_motor
from .injected_faults import InjectedFault
from .snapshot import Attributes, ObjectSnapshot
from .twin import Twin


class VirtualBusPort:
    """The master's end of the bus of a twin's drives.

    Waiting takes no real time: where nothing has come, ``read`` lets ``timeout`` seconds of virtual
    time pass. So a driver with time limits runs the same way on any machine.
    """

    def __init__(self, twin: Twin) -> None:
        self.timeout: float | None = None
        self._twin = twin
        self._received = bytearray()
        self._now = 0.0

    def now(self) -> float:
        """Return the virtual time [s]."""
        return self._now

    @property
    def in_waiting(self) -> int:
        """The number of bytes received and not read, with those that came late."""
        self._received += self._twin.read_late()
        return len(self._received)

    def write(self, data: bytes | bytearray) -> int:
        """Send bytes to the twin; its answers are there at once."""
        self._received += self._twin.write_bus(bytes(data))
        return len(data)

    def read(self, size: int = 1) -> bytes:
        """Up to ``size`` bytes; none after ``timeout`` of virtual time without any."""
        if not self._received:
            self._now += self.timeout or 0.0
            return b""
        part = bytes(self._received[:size])
        del self._received[:size]
        return part

    def reset_input_buffer(self) -> None:
        """Discard what was received and not read."""
        self._received.clear()

    def close(self) -> None:
        """Nothing to give back."""


class VirtualBoardPort(VirtualBusPort):
    """The host's end of a twin's sensor board."""

    def write(self, data: bytes | bytearray) -> int:
        """Send a command to the board."""
        self._twin.write_board(bytes(data))
        return len(data)

    def read(self, size: int = 1) -> bytes:
        """Up to ``size`` bytes of what the board has sent."""
        self._received += self._twin.read_board()
        return super().read(size)


class TwinParameters(SimulatorParameters, DriveParameters):
    """The parameters of ``TwinRobot``: those of ``MujocoRobot``, and the drives'."""

    armed: bool = parameter(True, text="switch the drives on; else they are only watched")
    hardware: str = parameter(
        "", text="file of the hardware, relative to the graph; none: addresses in order, no offsets"
    )
    faults: list[InjectedFault] = parameter([], text="faults of the devices, with their times")


class Registers(Signal):
    """Registers of the actuators, the buses and the driver."""

    values = Field("n_kept", text="all numbers in a fixed order")


class TwinRobot(SimulatedRobot, DrivenRobot):
    """The robot of the graph as its twin: the driver of ``BearRobot`` on emulated hardware.

    Every command and every measurement goes through the drivers of the real robot and the bytes of
    its protocols: checksums, float32, addresses, directions and offsets, error bytes, goals that
    are ignored beyond their limits. Behind them is the physics of ``MujocoRobot``, with the same
    parameters and the same world for a seed. The drives close their loops per motor.

    Time is virtual: an exchange on the bus is one period of physics, so a run is the same on every
    machine. A command acts in the first exchange at or after ``t_n + latency``, at the earliest one
    period after the tick; ``jitter`` and the drawn start phase are added behind the bus.

    A gantry holds the robot in its standing pose until the drives are on and get a first current.

    ``actuators.drive_damping`` is not used: drives in damping brake as shorted windings do. Nor is
    ``actuators.bus_period``: the file of the hardware has it.
    """

    Params = TwinParameters
    params: TwinParameters

    gantry = State(DriveState, text="the gantry's hold on the robot")
    record = State(TickRecord, text="sums over the physics steps of the last tick")
    rest = State(Registers, text="registers, counters and commands on their way, for a snapshot")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report what neither simulator nor drives can do, periods that do not divide each other,
        and a wrong file of the hardware."""
        robot = context.robot
        assert isinstance(params, TwinParameters) and robot is not None
        yield from super().requires(params, context)
        complaint = unsupported_motor(robot) or uneven_contacts(robot)
        if complaint:
            yield UnmetRequirement(complaint, fix="correct the robot's description")
        yield from impossible_effects(params, robot)
        if len(robot.contacts) > 7:
            yield UnmetRequirement(
                f"{robot.name} has {len(robot.contacts)} contact points, and a packet of the "
                "sensor board has room for 7 switches"
            )
        if len(robot.joints) > 18:
            yield UnmetRequirement(
                f"{robot.name} has {len(robot.joints)} motors, and one exchange has room for 18"
            )
        period = 0.001
        if params.hardware:
            try:
                hardware = read_hardware(params.hardware, context, robot)
                period = hardware.bus.period
                yield from missing_sensors(hardware, robot)
            except Exception as error:  # noqa: BLE001  # said in the load report
                yield UnmetRequirement(str(error), parameter="hardware", found=params.hardware)
        for what, longer, shorter in (
            ("the bus's period", context.period, period),
            ("timestep", period, params.timestep),
        ):
            ratio = longer / shorter
            if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
                yield UnmetRequirement(
                    f"{what} {shorter} s does not divide {longer} s",
                    parameter="timestep" if what == "timestep" else "",
                )

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Sizes of the simulator's state, and of all that the twin and its driver keep."""
        assert isinstance(params, TwinParameters) and robot is not None
        sizes = {**robot.dimensions, **Plant.state_dimensions(params, robot), "n_queue": 2}
        hardware = Hardware.for_twin(robot)
        twin = Twin(
            robot, params, hardware, hardware.bus.period, PhysicsState.allocate(sizes),
            TickRecord.allocate(sizes), DriveState.allocate(sizes),
        )  # fmt: skip
        driver = _driver(robot, params, hardware, twin)
        queue = CommandQueue(driver.loop, robot, params.latency, hardware.bus.period)
        kept = ObjectSnapshot(_parts(twin, driver, queue))
        return {**sizes, "n_kept": kept.size}

    def setup(self) -> None:
        """Draw the world from the seed and build the twin."""
        super().setup()
        params, robot = self.params, self.robot
        if params.hardware:
            hardware = read_hardware(params.hardware, self.context, robot)
        else:
            hardware = Hardware.for_twin(robot)
        self.twin = Twin(
            robot, params, hardware, self.period, self.physics, self.record, self.gantry,
            tuple(params.faults), getattr(self, "sensor_memory", None),
        )  # fmt: skip
        self.twin.set_push(self.push)
        self._reporting = self.twin.plant.truth.report_calls(self.truth)
        self._hardware = hardware
        self.driver = _driver(robot, params, hardware, self.twin)
        self.driver.waits_for_windings = False
        self._queue = CommandQueue(self.driver.loop, robot, params.latency, self.period)
        self._kept = ObjectSnapshot(_parts(self.twin, self.driver, self._queue))

    def open(self) -> None:
        """Stand in the gantry, find the drives and, if armed, lead them to the standing pose."""
        twin = self.twin
        twin.stand()
        self._driver.connect()
        if self.params.armed:
            self._driver.arm(lambda: True)
        twin.clear_record()
        self._driver.loop.cycle()

    def now(self) -> float:
        """Return the virtual time [s]."""
        return self.twin.exchanges * self._hardware.bus.period

    def read(self) -> None:
        """Publish the newest measurements, and the truth."""
        super().read()
        for call in self._reporting:
            call.run()

    def write(self) -> None:
        """Send the command on its way to the drives."""
        self._queue.give(self.command)
        self.stop_after_fault()

    def advance(self) -> None:
        """Exchange with the drives until the next tick."""
        self._pass_time(self._queue.advance)

    def damp(self) -> None:
        """One tick with the drives in damping and no external force."""
        self.twin.set_push(None)
        self._pass_time(lambda: self._driver.damp(self._queue.cycles))

    def _pass_time(self, exchange: Callable[[], None]) -> None:
        """Exchange for a tick; with a lost link, time passes without exchanges."""
        twin = self.twin
        twin.clear_record()
        end = twin.exchanges + self._queue.cycles
        exchange()
        while twin.exchanges < end:
            twin.advance()

    def save_state(self) -> None:
        """Copy all that is kept elsewhere to the declared state."""
        self.twin.plant.save()
        self._kept.save(self.rest.values)

    def load_state(self) -> None:
        """Restore it from there."""
        self.twin.plant.load()
        self._kept.load(self.rest.values)
        self._driver.loop.restored()

    def metrics(self) -> Mapping[str, Metric]:
        """Return the values drawn from the seed, and the outcome of the drives."""
        return {**self.twin.plant.metrics(), **super().metrics()}

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """All disturbances at once, so that the conformance suite covers them."""
        return {
            "latency": 0.002, "jitter": 0.0005,
            "start": {"initial_attitude_error": 0.01, "random_start_phase": True},
            "sensors": {
                "gyro_noise": 0.02, "gyro_bias": 0.01, "accelerometer_noise": 0.1,
                "accelerometer_bias": 0.1, "encoder_offset": 0.003, "joint_velocity_noise": 0.05,
                "switch_threshold": [0.5, 3.0], "switch_bounce": 0.002,
            },
        }  # fmt: skip


def _driver(
    robot: RobotDescription, params: TwinParameters, hardware: Hardware, twin: Twin
) -> Driver:
    gains = joint_gains(params, robot)
    law = DriveLaw(robot, *gains, hardware.bus.lead, params.motor_model)
    ports = VirtualBusPort(twin), VirtualBoardPort(twin)
    return Driver(robot, hardware, *ports, law, params.planned_load)


def _parts(twin: Twin, driver: Driver, queue: CommandQueue) -> list[Attributes]:
    """All that changes in a run and lies in no declared state."""
    return [*twin.parts(), *driver.loop.parts(), *queue.parts()]
