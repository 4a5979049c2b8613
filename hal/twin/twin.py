"""A robot's twin: the plant behind the bus of its drives and the port of its sensor board."""

from __future__ import annotations

import math

import numpy as np

from ...blocks.signals import ExternalForce, ImuReading, JointState
from ...mathematics.arrays import Array, Indices
from ...mathematics.compiling.call_sequence import CallSequence
from ...mathematics.compiling.foreign_call import ForeignCall
from ...robots.robot_description import RobotDescription
from ..bear.configuration import Hardware
from ..bear.protocol import BROADCAST, Instruction, frame_bytes
from ..random_streams import Purpose
from ..sensors.sensor import mounted_sensors
from ..simulated.drives import SimulatedDrives
from ..simulated.parameters import SimulatorParameters
from ..simulated.plant import Plant
from ..simulated.state import DriveState, PhysicsState, SensorMemory, TickRecord
from .devices import EmulatedActuator, EmulatedBoard, EmulatedBus
from .drives import EmulatedDrives
from .injected_faults import ANSWERS, InjectedFault, InjectedFaults, apply_fault, corrupt_byte
from .snapshot import Attributes

BRAKING = 0.5
"""Braking of an actuator with shorted windings [N m s/rad]: an estimate."""
SUPPLY = 14.8
"""The battery's voltage [V]."""


class PulledCableError(OSError):
    """The twin's cable was pulled."""


class Twin:
    """Drives, sensor board and mechanics of a robot, as their ports see them.

    Its time goes on when the master exchanges with all drives (``BULK``): first one period of
    physics with the goals so far, then the board's packet of this instant, then the new goals and
    the answers of this instant. So a driver that exchanges, then reads the board, gets the same
    bytes in every run, however long it takes. ``advance`` lets time go on without an exchange.

    A gantry holds the robot in its standing pose, and adds to the torques of the drives, until the
    first current is commanded of drives that are all on. That is instant zero.

    Goals act at the first physics step after the exchange plus the plant's drawn start phase and
    ``jitter``; the ``latency`` is the driver's.

    Args:
        robot: the description.
        params: world, disturbances and sensors' errors, as of ``MujocoRobot``. Noise of the
            accelerometer is that of the mean over ``tick``; a packet has accordingly more.
        hardware: addresses, directions, offsets and the bus's period.
        tick: the control period [s].
        physics, record, gantry: memory of the plant and of the gantry.
        faults: of the devices.
        sensed: memory of the sensors that the description mounts; by default it is allocated.
    """

    def __init__(
        self, robot: RobotDescription, params: SimulatorParameters, hardware: Hardware, tick: float,
        physics: PhysicsState, record: TickRecord, gantry: DriveState, faults: tuple[InjectedFault, ...] = (),
        sensed: SensorMemory | None = None,
    ) -> None:  # fmt: skip
        period = hardware.bus.period
        errors = params.sensors
        finer = {"accelerometer_noise": errors.accelerometer_noise * math.sqrt(tick / period)}
        changed = {"sensors": errors.model_copy(update=finer)}
        self.plant = Plant(
            robot, params.model_copy(update=changed), tick, physics, record, sensed, tick / period
        )
        self._names = robot.transmission.motors
        self.actuators = [EmulatedActuator(hardware.motors[name].id) for name in self._names]
        self._by_device = {actuator.device: k for k, actuator in enumerate(self.actuators)}
        self.bus = EmulatedBus(self.actuators, self._answer_with_faults)
        self.board = EmulatedBoard()
        self.drives = EmulatedDrives(robot, hardware, self.actuators, record, BRAKING)
        self.limits = self.drives.limits
        self.faults = InjectedFaults(faults, params.seed)
        self.lockstep = True
        """True if time goes on with the exchanges; else it does only by ``advance``."""
        self.released = False
        self.exchanges = 0
        self.zero = 0
        """The exchange in which the gantry let go."""
        self._gantry = SimulatedDrives(robot, self.plant.damping, gantry, record)
        self._held = np.zeros(len(robot.joints))
        self._standing = self.plant.simulation(self._gantry, 1)
        self._step = self.plant.simulation(self, 1)
        self._pushed = self._step
        self._push: ExternalForce | None = None
        self._record, self._params, self._hardware = record, params, hardware
        self._steps = round(period / params.timestep)
        self._period = period
        self._jitter = self.plant.streams[Purpose.JITTER]
        self._points = [contact.name for contact in robot.contacts]
        self._order = [self._points.index(name) for name in hardware.board.switches]
        n = len(self._names)
        self._sample = JointState.allocate(robot.dimensions)
        self._imu = ImuReading.allocate()
        self.closed = np.zeros(len(self._points), dtype=np.bool_)
        self._packet_closed = np.zeros(len(self._order), dtype=np.bool_)
        self._to_base = hardware.board.imu_to_base
        self._turned = any(hardware.board.imu_rotation)
        self._opens = [name in hardware.board.normally_closed for name in hardware.board.switches]
        self.before, self._force = np.zeros(3), np.zeros(3)
        self.counted = 0
        self._current, self._nothing = np.zeros(n), np.zeros(n)
        plant, sensors = self.plant, self.plant.sensors
        self._reading_joints = CallSequence(
            sensors.joint_calls(*plant.sensed, self._nothing, self._sample)
        )
        self._reading_imu = CallSequence(plant.imu_calls(self._force, self._imu))
        self._reading_switches = CallSequence(plant.switch_calls(self.closed))
        self._samples = {
            sensor.name: sensor.signal.allocate(robot.dimensions)
            for sensor in mounted_sensors(robot)
        }
        self._reading_mounted = CallSequence(sensors.mounted_calls(self._samples))
        self._on_board = hardware.board.mounted(robot)
        self._packet = b""
        self._to_board = b""
        self._late = b""
        self.last_packet = np.zeros((2, 3))

    def stand(self) -> None:
        """Stand on the ground, held by the gantry.

        Raises:
            StartError: the robot does not stand as its description says.
        """
        plant = self.plant
        plant.stand(
            self._standing,
            lambda pose, torque: self._gantry.hold(pose, torque, plant.stiffness, plant.damping),
        )
        self._feed_drives()
        self._sense()
        self._begin_packet()

    def parts(self) -> list[Attributes]:
        """Return the attributes that change in a run, beside the memory that was given."""
        names = ("released", "exchanges", "zero", "before", "counted", "last_packet", "closed")
        found: list[Attributes] = [(self, names), *self.drives.parts()]
        found += [
            (actuator, ("status", "config", "errors", "corrupt", "silent_time"))
            for actuator in self.actuators
        ]
        return [*found, (self.board, ("mode", "cooling"))]

    # -- the ports ---------------------------------------------------------------------------

    def write_bus(self, data: bytes) -> bytes:
        """Take what the master sends on the drives' bus; gives what it receives.

        Raises:
            PulledCableError: the cable is pulled.
        """
        bulk = len(data) > 4 and data[2] == BROADCAST and data[4] == Instruction.BULK
        if bulk and self.lockstep:
            self.advance()
        if self.faults.active("pulled_cable"):
            raise PulledCableError("the cable of the drives' bus is pulled")
        for fault in self.faults.of("", "corrupted_request"):
            data = corrupt_byte(data, self.faults.draw(fault.kind, 1))
        answers = self.bus.receive(data)
        step = int(self.plant.physics.step)
        if bulk:
            delay = self.plant.start_delay
            if self._params.jitter:
                delay += self._params.jitter * self._jitter.random()
            step += math.ceil(delay / self._params.timestep - 1e-9)
        self.drives.take_goals(step)
        foreign = b""
        if self.faults.active("second_writer"):
            foreign = frame_bytes(1, Instruction.READ_STATUS, b"\x09")
        return answers + foreign

    def read_late(self) -> bytes:
        """Answers that come after the master has given up waiting for them."""
        data, self._late = self._late, b""
        return data

    def read_board(self) -> bytes:
        """Read the bytes that the sensor board has sent since the last read.

        Raises:
            PulledCableError: its cable is pulled.
        """
        if self.faults.active("pulled_board"):
            raise PulledCableError("the cable of the sensor board is pulled")
        data, self._to_board = self._to_board, b""
        return data

    def write_board(self, data: bytes) -> None:
        """Take what the host sends to the sensor board."""
        self.board.receive(data)

    # -- time --------------------------------------------------------------------------------

    def advance(self) -> None:
        """Let one period of the bus pass, and let the board send its packet."""
        self.exchanges += 1
        self.faults.exchange = self.exchanges
        self.faults.now = (self.exchanges - self.zero) * self._period if self.released else -1.0
        self._apply_drive_faults()
        for _ in range(self._steps):
            (self._pushed if self.released else self._step).run()
            if self._push is not None:
                self.plant.forces.check(self._push)
        for actuator in self.actuators:
            actuator.advance(self._period)
        self.drives.take_states()
        self._sense()
        self._send_packet()

    def set_push(self, push: ExternalForce | None) -> None:
        """Apply this force from outside from now on, once the gantry has let go; ``None``: none."""
        self._push = push
        self._pushed = self._step if push is None else self.plant.simulation(self, 1, push)

    def torque_call(
        self, step: Indices, position: Array, velocity: Array, speed: Array, out: Array
    ) -> ForeignCall:
        """Return the call for the torques of the drives, and of the gantry until it lets go."""
        holding = self._gantry.torque_call(step, position, velocity, speed, self._held)

        def write() -> None:
            self.drives.joint_torque(int(step), position, velocity, speed, out)
            self._release_gantry()
            if not self.released:
                holding.run()
                np.add(out, self._held, out=out)

        return ForeignCall(write, 0)

    def clear_record(self) -> None:
        """Begin a new record of torques, loads and limits; packets go on."""
        np.subtract(self.before, self._record.accelerometer, out=self.before)
        self.counted -= int(self._record.steps)
        self.plant.clear_record()

    def _release_gantry(self) -> None:
        """Let go of the robot when all drives are on and one has a current as its goal."""
        if not self.released and self.drives.enabled.all() and self.drives.goals[:, 0].any():
            self.released = True
            self.zero = self.exchanges - 1
            if self.plant.gantry is not None:
                self.plant.gantry.lower(self.plant.physics.step)

    # -- what is measured --------------------------------------------------------------------

    def _sense(self) -> None:
        """Put what the drives measure now into their registers."""
        sample, drives = self._sample, self.drives
        self._reading_joints.run()
        drives.sense(sample.position, sample.velocity)
        drives.mean_current(self._current)
        for k, actuator in enumerate(self.actuators):
            status = actuator.status
            status["present_position"] = drives.position.item(k)
            status["present_velocity"] = drives.velocity.item(k)
            status["present_iq"] = self._current.item(k)

    def _begin_packet(self) -> None:
        for sensor in self.plant.sensors.mounted:
            sensor.reset()
        self.before[:] = self._record.accelerometer
        self.counted = int(self._record.steps)

    def _send_packet(self) -> None:
        """Send a packet of the IMU and the switches: the accelerometer's mean since the last one."""
        record = self._record
        np.subtract(record.accelerometer, self.before, out=self._force)
        np.divide(self._force, int(record.steps) - self.counted, out=self._force)
        self._reading_mounted.run()
        mounted = b"".join(each.to_packet(self._samples[each.name]) for each in self._on_board)
        self._begin_packet()
        imu = self._imu
        self._reading_imu.run()
        if self._turned:
            for reading in (imu.specific_force, imu.angular_velocity):
                reading[:] = np.dot(reading, self._to_base)
        self._read_switches()
        if self.faults.active("frozen_imu"):
            imu.specific_force[:], imu.angular_velocity[:] = self.last_packet
        self.last_packet[0], self.last_packet[1] = imu.specific_force, imu.angular_velocity
        if self.faults.active("saturated_gyro"):
            imu.angular_velocity[0] = self._hardware.board.gyro_range
        if not self.faults.active("silent_board"):
            self._to_board += self.board.packet(imu, self._packet_closed, mounted)

    def _read_switches(self) -> None:
        closed = self.closed
        self._reading_switches.run()
        if self.faults:
            for k, name in enumerate(self._points):
                if self.faults.of(name, "stuck_switch"):
                    closed[k] = True
                if self.faults.of(name, "open_switch"):
                    closed[k] = False
                if self.faults.of(name, "bouncing_switch"):
                    closed[k] = bool(self.faults.draw(name, 2).random() < 0.5)
        for bit, point in enumerate(self._order):
            self._packet_closed[bit] = closed[point] != self._opens[bit]

    # -- what goes wrong ---------------------------------------------------------------------

    def _apply_drive_faults(self) -> None:
        """Let faults of drives begin and end."""
        if self.plant.battery is not None or self.plant.windings is not None:
            self._feed_drives()
        if not self.faults:
            return
        for k, (name, actuator) in enumerate(zip(self._names, self.actuators, strict=True)):
            self.drives.stuck[k] = bool(self.faults.of(name, "stuck_encoder"))
            low, hot = self.faults.of(name, "low_voltage"), self.faults.of(name, "hot")
            actuator.status["input_voltage"] = low[0].value if low else self.plant.voltage(SUPPLY)
            measured = self.plant.temperature(k)
            actuator.status["winding_temperature"] = hot[0].value if hot else measured
            if self.faults.of(name, "dead"):
                actuator.status["torque_enable"] = 0.0

    def _feed_drives(self) -> None:
        """Write the supply's voltage and the windings' temperature into the drives' registers."""
        for k, actuator in enumerate(self.actuators):
            actuator.status["input_voltage"] = self.plant.voltage(SUPPLY)
            actuator.status["winding_temperature"] = self.plant.temperature(k)

    def _answer_with_faults(self, device: int, answer: bytes) -> bytes:
        """Return the bytes of an answer that really travel."""
        if not self.faults:
            return answer
        name = self._names[self._by_device[device]]
        if self.faults.of(name, "dead"):
            return b""
        for fault in self.faults.of(name, *ANSWERS):
            if fault.kind == "late":
                self._late += answer
            answer = apply_fault(fault, answer, self.faults.draw(name, 3))
            if not answer:
                break
        return answer


def standing_twin(
    robot: RobotDescription, params: SimulatorParameters, hardware: Hardware,
    tick: float = 0.002, faults: tuple[InjectedFault, ...] = (),
) -> Twin:  # fmt: skip
    """Build a twin that stands in its gantry.

    Args:
        robot: the description.
        params: world, disturbances and sensors' errors.
        hardware: addresses, directions, offsets and the bus's period.
        tick: the control period [s], to which noise and start phase refer.
        faults: of the devices.

    Raises:
        StartError: the robot does not stand as its description says.
    """
    sizes = {**robot.dimensions, **Plant.state_dimensions(params, robot), "n_queue": 2}
    twin = Twin(
        robot, params, hardware, tick, PhysicsState.allocate(sizes), TickRecord.allocate(sizes),
        DriveState.allocate(sizes), faults,
    )  # fmt: skip
    twin.stand()
    return twin
