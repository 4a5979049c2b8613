"""The effects that the parameters of a simulated robot ask for, in the order in which a physics step has them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from ...robots.description import RobotDescription
from .base import FixedBase
from .battery import Battery
from .drive_effects import EncoderDelays, MotorLosses, drawn_constants
from .effect import Effect
from .effects import EncoderEffects, MotorEffects, SwitchEffects
from .external_forces import Cable
from .gantry import Gantry
from .gears import YieldingGears
from .imu_effects import ImuModel
from .parameters import SimulatorParameters
from .state import PhysicsState
from .stribeck import FallingFriction
from .switch_effects import SwitchDelays
from .variation import Variation
from .windings import Windings

if TYPE_CHECKING:
    from mujoco import MjData, MjModel


def chosen_effects(
    params: SimulatorParameters, robot: RobotDescription, variation: Variation,
    model: MjModel, data: MjData, base: FixedBase, memory: PhysicsState,
) -> list[Effect]:  # fmt: skip
    """Make the effects of a simulated robot.

    A pack comes behind the windings, whose resistance it sees; the motors give less than is asked before gears
    pass it on; encoders read what the gears turn.
    """
    seed, step = params.seed, params.timestep
    sensors, actuators = params.sensors, params.actuators

    def effects() -> Iterator[Effect]:
        if not sensors.imu.ideal:
            yield ImuModel(sensors.imu, seed, step, memory)
        warm = None
        if actuators.windings is not None:
            constants = drawn_constants(robot, actuators.motors, seed)
            windings = Windings(actuators.windings, robot, constants, step, memory)
            warm = windings.warm
            yield windings
        if actuators.battery is not None:
            yield Battery(actuators.battery, robot, step, memory, warm)
        if warm is not None or actuators.motors != MotorEffects():
            constant = None if warm is None else warm.constant
            yield MotorLosses(robot, actuators.motors, seed, step, memory, constant)
        if variation.static_friction:
            loss = model.dof_frictionloss[base.velocities :]
            velocity = actuators.joints.stribeck_velocity
            yield FallingFriction(loss, variation.static_friction, velocity)
        if sensors.switches != SwitchEffects():
            yield SwitchDelays(sensors.switches, step, memory)
        if actuators.gears is not None:
            yield YieldingGears(actuators.gears, robot, variation.rotors(robot), step, memory)
        if sensors.encoders != EncoderEffects():
            yield EncoderDelays(robot, sensors.encoders, seed, step, memory)
        if params.body.cable is not None:
            yield Cable(params.body.cable, seed, robot, model, data)
        if params.start.gantry is not None and base.velocities:
            yield Gantry(params.start.gantry, robot, model, data, memory, step)

    return list(effects())


def effect_dimensions(params: SimulatorParameters, robot: RobotDescription) -> Mapping[str, int]:
    """Return the sizes of what the effects keep in ``PhysicsState``."""
    n, sensors, actuators = len(robot.joints), params.sensors, params.actuators
    motors = actuators.motors != MotorEffects() or actuators.windings is not None
    return {
        **ImuModel.dimensions(sensors.imu, params.timestep),
        **EncoderDelays.dimensions(robot, sensors.encoders, params.timestep),
        "n_real_motors": n if motors else 0,
        "n_windings": 0 if actuators.windings is None else n,
        "n_rotors": 0 if actuators.gears is None else n,
        "n_gantry": 0 if params.start.gantry is None else 4,
        "n_battery": 0 if actuators.battery is None else 4,
        "n_late_switches": 0 if sensors.switches == SwitchEffects() else len(robot.contacts),
    }
