"""Windings that warm: what their temperature takes of a simulated robot's motors.

Copper heat warms a winding, and what cools it takes the heat away (one node, first order)::

    C T' = R I^2 - (T - T_a) / R_th,    R = R_25 (1 + a (T - 25)),    k = k_25 (1 - b (T - 25))

The resistance R of copper grows by a = 0.39 %/K, and the torque constant k falls with the remanence of the
magnets, b = 0.12 %/K for neodymium-iron-boron (makers' data sheets: -0.11 to -0.12 %/K), which are taken to be
as warm as the winding. A drive believes in the constant at 25 deg C, by which it reports torques. At a voltage
U the current is at most (U - k v) / R, so a warm motor reaches a higher speed without load, and
loses torque sooner with speed below it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...blocks.signals import RobotHealth
from ...mathematics.arrays import Array, Array1D
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...runtime.language.steps import signal_call
from .drives import DriveTrain, MotorLimits, MotorScratch
from .effect import Effect, StepViews
from .effects import WindingParameters
from .state import PhysicsState

NOMINAL = 25.0
"""The temperature at which the numbers of a description hold [deg C]."""


class WindingModel(NamedTuple):
    """The windings as numbers: ``magnets`` and ``copper`` [1/K], by which torque constants fall and resistances
    grow; the ``ambient`` temperature [deg C]; ``capacity`` [J/K] of a winding and the ``share`` of its distance
    from the ambient temperature that it cools in a step, of ``timestep`` [s]. Of every motor when nominal, (n,):
    ``constant``, the factor on its torque constant; ``heating`` [W/(N m)^2]; ``slope`` and ``no_load``."""

    magnets: float
    copper: float
    ambient: float
    capacity: float
    share: float
    timestep: float
    constant: Array1D
    heating: Array1D
    slope: Array1D
    no_load: Array1D


class WarmMotors(NamedTuple):
    """The same four of the motors as warm as they are, (n,)."""

    constant: Array1D
    heating: Array1D
    slope: Array1D
    no_load: Array1D


@kernel
def warm_motors(
    model: WindingModel, warm: WarmMotors, motors: DriveTrain, memory: PhysicsState
) -> None:
    """Limit the motors to the torques that they can give at their temperature; a pack scales that further."""
    for k in range(warm.constant.shape[0]):
        above = memory.winding_temperature[k] - NOMINAL
        weaker = max(1.0 - model.magnets * above, 0.05)
        resistance = max(1.0 + model.copper * above, 0.05)
        warm.constant[k] = model.constant[k] * weaker
        warm.heating[k] = model.heating[k] * resistance
        warm.no_load[k] = model.no_load[k] / weaker
        warm.slope[k] = model.slope[k] * weaker / resistance
        motors.no_load[k] = warm.no_load[k]
        motors.slope[k] = warm.slope[k]


@kernel
def heat_windings(
    model: WindingModel, warm: WarmMotors, scratch: MotorScratch, memory: PhysicsState
) -> None:
    """Compute the temperatures after a physics step with these currents, as nominal torques."""
    for k in range(warm.heating.shape[0]):
        torque = scratch.torque[k]
        heat = warm.heating[k] * torque * torque * model.timestep
        beyond = memory.winding_temperature[k] - model.ambient
        memory.winding_temperature[k] += heat / model.capacity - model.share * beyond


@kernel
def read_temperatures(windings: Array1D, drives: Array1D) -> None:
    """Every drive sees the temperature of its winding [deg C]."""
    drives[:] = windings


class Windings(Effect):
    """The windings of a simulated robot.

    Args:
        params: of the windings.
        robot: whose description has a ``supply``; it or ``params`` describe how windings are heated and cooled.
        constant: the factors on the torque constants at 25 deg C, (n_joints,); a copy is kept.
        timestep: of the physics [s].
        memory: keeps the temperatures.

    Attributes:
        warm: the motors at their temperature, in arrays that keep their place.
    """

    def __init__(
        self, params: WindingParameters, robot: RobotDescription, constant: Array, timestep: float,
        memory: PhysicsState,
    ) -> None:  # fmt: skip
        supply, motors = params.of(robot), robot.motors
        capacity, resistance = supply.winding_heat_capacity, supply.winding_thermal_resistance
        assert capacity is not None and resistance is not None
        self._model = WindingModel(
            params.magnets, params.copper, params.ambient, capacity,
            timestep / (capacity * resistance), timestep, constant.copy(), supply.heating(motors),
            motors.peak_torque / (motors.no_load_speed - motors.corner_speed),
            np.array(motors.no_load_speed),
        )  # fmt: skip
        self.warm = WarmMotors(*(each.copy() for each in self._model[-4:]))
        self._start, self._memory = params.temperature, memory

    def begin(self, position: Array) -> None:
        """All windings are as warm as at the start."""
        self._memory.winding_temperature[:] = self._start

    def limit_calls(self, limits: MotorLimits) -> list[Call]:
        """Set what the motors can do at their temperature."""
        return [self.limit_call(limits)]

    def torque_calls(self, views: StepViews, limits: MotorLimits) -> list[Call]:
        """Heat the windings, and let them cool."""
        return [self.heat_call(limits)]

    def limit_call(self, limits: MotorLimits) -> KernelCall:
        """Return the call that sets what the motors can do at their temperature."""
        return signal_call(warm_motors, self._model, self.warm, limits.motors, self._memory)

    def heat_call(self, limits: MotorLimits) -> KernelCall:
        """Return the call that heats the windings in a physics step, and lets them cool."""
        return signal_call(heat_windings, self._model, self.warm, limits.scratch, self._memory)

    def health_calls(self, health: RobotHealth) -> list[Call]:
        """Write the windings' temperatures [deg C]."""
        temperatures = self._memory.winding_temperature
        return [KernelCall(read_temperatures, temperatures, health.temperature)]

    def metrics(self) -> Mapping[str, float]:
        """Return the temperature of the hottest winding [deg C]."""
        return {"robot_hottest_winding_degc": float(self._memory.winding_temperature.max())}
