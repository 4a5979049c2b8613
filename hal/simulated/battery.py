"""The pack that feeds a simulated robot: its voltage sags under load, and with it the motors' speeds.

A pack is an open voltage behind a resistance, with a further part that builds up and recovers slowly
(one resistance beside one capacitor), and an open voltage that falls with the charge taken from it. The
load is what the motors turn into work and copper heat, and the board. Regenerated power charges it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...blocks.signals import RobotHealth
from ...mathematics.arrays import Array, Array1D
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.elementary import expm1
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...runtime.language.steps import signal_call
from .drives import DriveTrain, MotorLimits, MotorScratch
from .effect import Effect, StepViews
from .effects import BatteryParameters
from .state import PhysicsState
from .windings import WarmMotors


class Pack(NamedTuple):
    """The pack's parameters as numbers, and the motors' curves at the rated voltage and their copper heat for
    their torque squared [W/(N m)^2], (n_motors,)."""

    open_voltage: float
    resistance: float
    share: float
    recovery_resistance: float
    fall: float
    capacity: float
    board_power: float
    rated_voltage: float
    timestep: float
    slope: Array1D
    no_load: Array1D
    heating: Array1D


@kernel
def draw_power(pack: Pack, scratch: MotorScratch, memory: PhysicsState) -> None:
    """Compute the voltage after a physics step with these motor torques and speeds.

    ``memory.battery`` holds the voltage [V], the charge that is gone [C], the voltage that is still to
    recover [V], and the current [A].
    """
    power = pack.board_power
    for k in range(scratch.torque.shape[0]):
        torque = scratch.torque[k]
        power += torque * scratch.speed[k] + pack.heating[k] * torque * torque
    battery = memory.battery
    inner = pack.open_voltage - pack.fall * battery[1] / pack.capacity - battery[2]
    inner = max(inner, 0.0)
    voltage = 0.5 * inner
    if pack.resistance == 0.0:
        voltage = inner
    else:
        # Beyond this root the load asks for more than the pack can give at any current.
        root = inner * inner - 4.0 * pack.resistance * power
        if root > 0.0:
            voltage = 0.5 * (inner + math.sqrt(root))
    current = 0.0
    if voltage > 0.0:
        current = min(power / voltage, inner / (2.0 * pack.resistance + 1e-9))
    battery[0] = voltage
    battery[1] += current * pack.timestep
    battery[2] += pack.share * (pack.recovery_resistance * current - battery[2])
    battery[3] = current


@kernel
def limit_by_voltage(pack: Pack, motors: DriveTrain, memory: PhysicsState) -> None:
    """Limit the motors to the torques that they can give at the pack's voltage."""
    ratio = max(memory.battery[0] / pack.rated_voltage, 0.05)
    for k in range(pack.no_load.shape[0]):
        motors.no_load[k] = pack.no_load[k] * ratio
        motors.slope[k] = pack.slope[k] / ratio


@kernel
def spread_voltage(voltage: Array1D, drives: Array1D) -> None:
    """Every drive sees the pack's ``voltage`` (1,)."""
    drives[:] = voltage[0]


class Battery(Effect):
    """The pack of a simulated robot.

    Args:
        params: of the pack.
        robot: whose description has a ``supply``.
        timestep: of the physics [s].
        memory: keeps voltage and charge.
        warm: the motors as their temperature leaves them; none: it does not change.
    """

    def __init__(
        self, params: BatteryParameters, robot: RobotDescription, timestep: float,
        memory: PhysicsState, warm: WarmMotors | None = None,
    ) -> None:  # fmt: skip
        p = self._supply = params.of(robot)
        motors, self._memory = robot.motors, memory
        slope = motors.peak_torque / (motors.no_load_speed - motors.corner_speed)
        curves = (slope, np.array(motors.no_load_speed), p.heating(motors))
        if warm is not None:
            curves = (warm.slope, warm.no_load, warm.heating)
        self._pack = Pack(
            p.open_voltage, p.resistance, -expm1(-timestep / params.recovery_time),
            p.recovery_resistance, p.fall, p.capacity, p.board_power, p.rated_voltage, timestep,
            *curves,
        )  # fmt: skip

    def begin(self, position: Array) -> None:
        """Begin with a pack that is full and has rested."""
        self._memory.battery[:] = [self._supply.open_voltage, 0.0, 0.0, 0.0]

    @property
    def voltage(self) -> Array:
        """The voltage [V], (1,), a view of the memory."""
        found: Array = self._memory.battery[:1]
        return found

    def limit_calls(self, limits: MotorLimits) -> list[Call]:
        """Set what the motors can do at the present voltage."""
        return [self.limit_call(limits)]

    def torque_calls(self, views: StepViews, limits: MotorLimits) -> list[Call]:
        """Feed the motors."""
        return [self.feed_call(limits)]

    def limit_call(self, limits: MotorLimits) -> KernelCall:
        """Return the call that sets what the motors can do at the present voltage."""
        return signal_call(limit_by_voltage, self._pack, limits.motors, self._memory)

    def feed_call(self, limits: MotorLimits) -> KernelCall:
        """Return the call that feeds the motors in a physics step."""
        return signal_call(draw_power, self._pack, limits.scratch, self._memory)

    def health_calls(self, health: RobotHealth) -> list[Call]:
        """Write the pack's voltage [V] for all drives."""
        return [KernelCall(spread_voltage, self.voltage, health.voltage)]
