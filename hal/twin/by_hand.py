"""A robot without power whose joints, body and switches a person moves, as its ports see it.

It has no dynamics: drives are off, and a hand puts every joint where it wants. ``Wiring`` says how
the robot is really built and wired, which its hardware's file may say otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...blocks.signals import ImuReading
from ...mathematics.arrays import Array
from ...robots.robot_description import RobotDescription
from ..bear.bring_up.session import PACKET_TIME, Request
from .devices import EmulatedActuator, EmulatedBoard, EmulatedBus

GRAVITY = 9.81
_MOVE = 0.26
_TURN_PACKETS = 400
_UP = {"back": (1.0, 0.0, 0.0), "right side": (0.0, 1.0, 0.0), "feet": (0.0, 0.0, 1.0)}


@dataclass
class Wiring:
    """How a robot is really built.

    Attributes:
        addresses: of every motor, by name; a motor that is left out is not on the bus.
        signs, zeros: of every motor: its drive says ``sign * (angle + zero)``.
        ratios: of every motor, how far its drive turns for its angle.
        jig_error: by how much every joint is off in the jig of the zero pose [rad].
        limits: of every joint [rad], by name.
        lengths: what a rule shows at a joint [m], by name.
        mass: what the scale shows [kg].
        deaf: whether the bus runs at another rate than the file says.
        voltage: of the supply [V].
        imu, gyro: columns are the robot's axes in the frame of accelerometer and gyroscope.
        force_scale, gyro_scale: of the sensors.
        bits: the contact point of each bit.
        inverted, stuck, broken: contact points whose switch is so; a stuck one is always closed.
        board_dead: whether the board sends nothing.
    """

    addresses: dict[str, int]
    limits: dict[str, tuple[float, float]]
    lengths: dict[str, float]
    mass: float
    bits: list[str]
    signs: dict[str, int] = field(default_factory=dict)
    zeros: dict[str, float] = field(default_factory=dict)
    ratios: dict[str, float] = field(default_factory=dict)
    jig_error: dict[str, float] = field(default_factory=dict)
    deaf: bool = False
    errors: dict[str, int] = field(default_factory=dict)
    enabled: set[str] = field(default_factory=set)
    voltage: float = 14.8
    imu: Array = field(default_factory=lambda: np.eye(3))
    gyro: Array | None = None
    force_scale: float = 1.0
    gyro_scale: float = 1.0
    inverted: set[str] = field(default_factory=set)
    stuck: set[str] = field(default_factory=set)
    broken: set[str] = field(default_factory=set)
    board_dead: bool = False

    @classmethod
    def of(cls, robot: RobotDescription) -> Wiring:
        """The wiring that a robot should have: addresses from 1, no signs and zeros."""
        return cls(
            addresses={name: k + 1 for k, name in enumerate(robot.transmission.motors)},
            limits={joint.name: joint.limits or (-1.0, 1.0) for joint in robot.joints},
            lengths={joint.name: float(np.linalg.norm(joint.origin)) for joint in robot.joints},
            mass=robot.total_mass,
            bits=[contact.name for contact in robot.contacts],
        )


class RobotByHand:
    """The robot on the bench, and the person who moves it: an ``Operator`` with two ports.

    Args:
        robot: the description.
        wiring: how it is really built.

    Attributes:
        bus_port, board_port: where the drives and the sensor board are.
        joints: where the hand has put them [rad], (n_joints,).
    """

    def __init__(self, robot: RobotDescription, wiring: Wiring) -> None:
        self.robot, self.wiring = robot, wiring
        self.joints = np.array(robot.standing_position, dtype=float)
        self.up = np.array([0.0, 0.0, 1.0])
        self.rate = np.zeros(3)
        self.pressed = ""
        self._actuators: dict[str, EmulatedActuator] = {}
        shared: dict[int, int] = {}
        for name, address in wiring.addresses.items():
            self._actuators[name] = EmulatedActuator(address)
            self._actuators[name].status["input_voltage"] = wiring.voltage
            self._actuators[name].errors = wiring.errors.get(name, 0)
            self._actuators[name].status["torque_enable"] = float(name in wiring.enabled)
            shared[address] = shared.get(address, 0) + 1
        self._shared = {address for address, count in shared.items() if count > 1}
        self.bus_port = HandPort(self._answer)
        self.board_port = HandPort(lambda data: b"", self._packet)
        self._bus = EmulatedBus(self._actuators.values(), self._collide)
        self._board = EmulatedBoard()
        self._imu = ImuReading.allocate()
        self._put()

    # -- the person --------------------------------------------------------------------------

    def measure(self, request: Request) -> float:
        """What a rule or the scale shows."""
        if request.target == "mass":
            return self.wiring.mass
        return 1e3 * self.wiring.lengths[request.target]

    def do(self, request: Request, observe: Callable[[], None]) -> None:
        """Move, place, turn or press, as asked."""
        names = [joint.name for joint in self.robot.joints]
        match request.act:
            case "move":
                self.joints[names.index(request.target)] += _MOVE
            case "stops":
                j = names.index(request.target)
                before = self.joints.item(j)
                for angle in self.wiring.limits[request.target]:
                    self.joints[j] = angle
                    self._put()
                    observe()
                self.joints[j] = before
            case "pose":
                self.joints[:] = [self.wiring.jig_error.get(name, 0.0) for name in names]
            case "place":
                self.up[:] = _UP[request.target]
            case "turn":
                self._turn("xyz".index(request.target), observe)
            case "press":
                self.pressed = request.target
            case _:
                raise ValueError(f"a hand cannot {request.act}")
        self._put()

    def _turn(self, axis: int, observe: Callable[[], None]) -> None:
        self.rate[axis] = 0.5 * np.pi / (_TURN_PACKETS * PACKET_TIME)
        for _ in range(_TURN_PACKETS):
            observe()
        self.rate.fill(0.0)

    # -- the devices -------------------------------------------------------------------------

    def _put(self) -> None:
        """Let the encoders say where the joints are."""
        angles = self.robot.joint_to_motor @ self.joints
        wiring = self.wiring
        for k, name in enumerate(self.robot.transmission.motors):
            if name in self._actuators:
                turned = wiring.ratios.get(name, 1.0) * angles.item(k) + wiring.zeros.get(name, 0.0)
                self._actuators[name].status["present_position"] = (
                    wiring.signs.get(name, 1) * turned
                )

    def _answer(self, data: bytes) -> bytes:
        return b"" if self.wiring.deaf else self._bus.receive(data)

    def _collide(self, device: int, answer: bytes) -> bytes:
        """Two drives with one address answer at once, and damage each other's bytes."""
        return answer[:-1] + bytes((answer[-1] ^ 0x55,)) if device in self._shared else answer

    def _packet(self) -> bytes:
        wiring = self.wiring
        if wiring.board_dead:
            return b""
        gyro = wiring.imu if wiring.gyro is None else wiring.gyro
        self._imu.specific_force[:] = wiring.force_scale * GRAVITY * (wiring.imu @ self.up)
        self._imu.angular_velocity[:] = wiring.gyro_scale * (gyro @ self.rate)
        closed = [self._closed(point) for point in wiring.bits]
        return self._board.packet(self._imu, np.array(closed))

    def _closed(self, point: str) -> bool:
        wiring = self.wiring
        closed = (point == self.pressed and point not in wiring.broken) or point in wiring.stuck
        return closed != (point in wiring.inverted)


class HandPort:
    """A serial port that answers at once, or sends a packet whenever it is read."""

    def __init__(
        self, answer: Callable[[bytes], bytes], stream: Callable[[], bytes] = lambda: b""
    ) -> None:
        self.timeout: float | None = None
        self._answer, self._stream = answer, stream
        self._waiting = b""

    @property
    def in_waiting(self) -> int:
        """How many bytes were not read."""
        return len(self._waiting)

    def write(self, data: bytes | bytearray, /) -> int:
        """Take the bytes, and have the answer waiting."""
        self._waiting += self._answer(bytes(data))
        return len(data)

    def read(self, size: int = 1, /) -> bytes:
        """What is waiting."""
        self._waiting += self._stream()
        part, self._waiting = self._waiting[:size], self._waiting[size:]
        return part

    def reset_input_buffer(self) -> None:
        """Discard what is waiting."""
        self._waiting = b""

    def close(self) -> None:
        """Nothing is open."""
