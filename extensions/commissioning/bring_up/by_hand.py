"""A robot on the bench and the person beside it, as its ports see them.

Without power it has no dynamics: drives are off, and a hand puts every joint where it wants, as exactly
as hands do. With power it is a ``Twin`` that hangs in a gantry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ....blocks.signals import ImuReading
from ....hal.simulated.effects import GantryParameters
from ....hal.simulated.parameters import SensorParameters, SimulatorParameters, StartParameters
from ....hal.twin.devices import EmulatedActuator, EmulatedBoard, EmulatedBus
from ....hal.twin.twin import Twin
from ....hal.twin.wiring import Wiring
from ....mathematics.constants import GRAVITY
from ....robots.robot_description import RobotDescription
from .session import PACKET_TIME, Request

_MOVE = 0.35
_TURN_PACKETS = 400
_UP = {"back": (1.0, 0.0, 0.0), "right side": (0.0, 1.0, 0.0), "feet": (0.0, 0.0, 1.0)}
_IN_THE_AIR, _ABOVE_GROUND = 0.1, 0.04
"""Height of the soles for tests in the air, and before the robot is lowered [m]."""
_LOWERED_AFTER = 0.6
"""Time from the first command of a graph until the person lowers the robot [s]."""


@dataclass(frozen=True)
class HandErrors:
    """Standard deviations of what a person does and measures, and of sensors at rest: estimates.

    Attributes:
        length, mass: of a rule [m] and a scale [share].
        move, shake: of the angle by which a joint is moved [share], and of the other joints meanwhile [rad].
        stop, jig: of a joint at its stop and in the jig [rad].
        side, turn, axis: of the side on which the robot lies [rad], of a turn [share] and its axis [rad].
        encoder, gyro, force: noise of a reading [rad, rad/s, m/s^2].
        gyro_bias, force_bias: half the width of the biases [rad/s, m/s^2].
    """

    length: float = 0.001
    mass: float = 0.005
    move: float = 0.2
    shake: float = 0.01
    stop: float = 0.008
    jig: float = 0.003
    side: float = 0.02
    turn: float = 0.03
    axis: float = 0.03
    encoder: float = 0.0003
    gyro: float = 0.02
    force: float = 0.1
    gyro_bias: float = 0.01
    force_bias: float = 0.1


STEADY = HandErrors(**dict.fromkeys(HandErrors.__dataclass_fields__, 0.0))
"""A person without errors, and ideal sensors."""


class RobotByHand:
    """The robot on the bench, and the person who moves it: an ``Operator`` with two ports.

    Args:
        robot: the description.
        wiring: how it is really built.
        seed: draws the errors of the person and of the sensors.
        errors: how large they are.

    Attributes:
        bus_port, board_port: where the drives and the sensor board are.
        joints: where the hand has put them [rad], (n_joints,).
        twin: the robot under power; ``None`` before it was hung up.
    """

    def __init__(
        self, robot: RobotDescription, wiring: Wiring, seed: int = 0, errors: HandErrors = STEADY
    ) -> None:
        self.robot, self.wiring = robot, wiring
        self.twin: Twin | None = None
        self._seed, self._errors, self._draw = seed, errors, np.random.default_rng(seed)
        self._gyro_bias = errors.gyro_bias * self._draw.uniform(-1.0, 1.0, 3)
        self._force_bias = errors.force_bias * self._draw.uniform(-1.0, 1.0, 3)
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
        self.board_port = HandPort(self._command, self._packet)
        self._bus = EmulatedBus(self._actuators.values(), self._collide)
        self._board = EmulatedBoard()
        self._imu = ImuReading.allocate()
        self._put()

    # -- the person --------------------------------------------------------------------------

    def measure(self, request: Request) -> float:
        """Return the reading of a rule [mm] or of the scale [kg]."""
        normal = self._draw.standard_normal()
        if request.target == "mass":
            return self.wiring.mass * (1.0 + self._errors.mass * normal)
        places = dict(zip(("imu x", "imu y", "imu z"), self.wiring.imu_position, strict=True))
        true = places.get(request.target, self.wiring.lengths.get(request.target, 0.0))
        return 1e3 * (true + self._errors.length * normal)

    def do(self, request: Request, observe: Callable[[], None]) -> None:
        """Move, place, turn, press or hang up, as asked."""
        names = [joint.name for joint in self.robot.joints]
        errors, normal = self._errors, self._draw.standard_normal
        self.twin = None  # it is switched off, unless it is hung up now
        match request.act:
            case "move":
                self.joints += errors.shake * normal(len(names))
                self.joints[names.index(request.target)] += _MOVE * (1.0 + errors.move * normal())
            case "stops":
                j = names.index(request.target)
                before = self.joints.item(j)
                for angle in self.wiring.limits[request.target]:
                    self.joints[j] = angle + errors.stop * normal()
                    self._put()
                    observe()
                self.joints[j] = before
            case "pose":
                self.joints[:] = [self.wiring.jig_error.get(name, 0.0) for name in names]
                self.joints += errors.jig * normal(len(names))
            case "place":
                self.up[:] = _UP[request.target] + errors.side * normal(3)
                self.up /= np.linalg.norm(self.up)
            case "turn":
                self._turn("xyz".index(request.target), observe)
            case "press":
                self.pressed = request.target
            case "hang":
                self.twin = self._hung(held=False, height=_IN_THE_AIR, lower_after=None)
            case "ready":
                self.twin = self._hung(held=True, height=_ABOVE_GROUND, lower_after=_LOWERED_AFTER)
            case _:
                raise ValueError(f"a hand cannot {request.act}")
        self._put()

    def _hung(self, *, held: bool, height: float, lower_after: float | None) -> Twin:
        """Return the robot in a gantry, with the noise of the errors."""
        errors = self._errors
        params = SimulatorParameters(
            seed=self._seed, timestep=PACKET_TIME if lower_after is None else 0.0005,
            sensors=SensorParameters(
                gyro_noise=errors.gyro, gyro_bias=errors.gyro_bias,
                accelerometer_noise=errors.force, accelerometer_bias=errors.force_bias,
                joint_velocity_noise=0.05 if errors.gyro else 0.0,
            ),
            start=StartParameters(
                gantry=GantryParameters(height=height, lower_after=lower_after)
            ),
        )  # fmt: skip
        return self.wiring.twin(self.robot, params, held=held)

    def _turn(self, axis: int, observe: Callable[[], None]) -> None:
        errors, normal = self._errors, self._draw.standard_normal
        turn = errors.axis * normal(3)
        turn[axis] = 1.0 + errors.turn * normal()
        self.rate[:] = turn * 0.5 * np.pi / (_TURN_PACKETS * PACKET_TIME)
        for _ in range(_TURN_PACKETS):
            observe()
        self.rate.fill(0.0)

    # -- the devices -------------------------------------------------------------------------

    def _put(self) -> None:
        """Write the joints' angles into the encoders' registers."""
        angles = self.robot.joint_to_motor @ self.joints
        wiring = self.wiring
        for k, name in enumerate(self.robot.transmission.motors):
            if name in self._actuators:
                turned = wiring.ratios.get(name, 1.0) * angles.item(k) + wiring.zeros.get(name, 0.0)
                noise = self._errors.encoder * self._draw.standard_normal()
                self._actuators[name].status["present_position"] = (
                    wiring.signs.get(name, 1) * turned + noise
                )

    def _answer(self, data: bytes) -> bytes:
        if self.twin is not None:
            return self.twin.write_bus(data)
        return b"" if self.wiring.deaf else self._bus.receive(data)

    def _collide(self, device: int, answer: bytes) -> bytes:
        """Two drives with one address answer at once, and damage each other's bytes."""
        return answer[:-1] + bytes((answer[-1] ^ 0x55,)) if device in self._shared else answer

    def _command(self, data: bytes) -> bytes:
        if self.twin is not None:
            self.twin.write_board(data)
        return b""

    def _packet(self) -> bytes:
        if self.twin is not None:
            return self.twin.read_board()
        wiring, errors, normal = self.wiring, self._errors, self._draw.standard_normal
        if wiring.board_dead:
            return b""
        gyro = wiring.imu if wiring.gyro is None else wiring.gyro
        force = wiring.force_scale * GRAVITY * (wiring.imu @ self.up)
        rate = wiring.gyro_scale * (gyro @ self.rate)
        self._imu.specific_force[:] = force + self._force_bias + errors.force * normal(3)
        self._imu.angular_velocity[:] = rate + self._gyro_bias + errors.gyro * normal(3)
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
        """The number of bytes not yet read."""
        return len(self._waiting)

    def write(self, data: bytes | bytearray, /) -> int:
        """Take the bytes, and have the answer waiting."""
        self._waiting += self._answer(bytes(data))
        return len(data)

    def read(self, size: int = 1, /) -> bytes:
        """Read the bytes that wait."""
        self._waiting += self._stream()
        part, self._waiting = self._waiting[:size], self._waiting[size:]
        return part

    def reset_input_buffer(self) -> None:
        """Discard what is waiting."""
        self._waiting = b""

    def close(self) -> None:
        """Nothing is open."""
