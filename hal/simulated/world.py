"""The world that a seed stands for: the values drawn once, and the simulator's model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...robots.description import RobotDescription
from .mujoco_model import Variation, build_mujoco_model
from .parameters import SimulatorParameters
from .random_streams import Purpose, stream

if TYPE_CHECKING:
    from mujoco import MjModel


def draw_variation(params: SimulatorParameters) -> Variation:
    """Draw the variation of the world from the seed in these parameters."""

    def uniform(purpose: Purpose) -> float:
        return float(stream(params.seed, purpose).uniform(-1.0, 1.0))

    friction = params.friction
    if params.friction_range is not None:
        low, high = params.friction_range
        friction = low + (high - low) * 0.5 * (1.0 + uniform(Purpose.FRICTION))
    stiffness = params.contact_stiffness * params.contact_stiffness_spread ** uniform(
        Purpose.CONTACT_STIFFNESS
    )
    offsets = stream(params.seed, Purpose.BASE_COM).uniform(-1.0, 1.0, 3)
    x, y, z = (
        nominal + params.base_com_spread * float(draw)
        for nominal, draw in zip(params.base_com_offset, offsets, strict=True)
    )
    mass = params.mass_scale * (1.0 + params.mass_spread * uniform(Purpose.MASS))
    return Variation(friction, stiffness, mass, (x, y, z), params.joint_friction)


def build_world(
    params: SimulatorParameters, robot: RobotDescription, variation: Variation
) -> MjModel:
    """The simulator's model of the robot in the scene these parameters describe.

    Raises:
        ValueError: the simulator cannot express the robot; see ``build_mujoco_model``.
    """
    import mujoco

    model = build_mujoco_model(
        robot, scene=params.build_scene(), timestep=params.timestep, variation=variation
    )
    # A state that has become NaN must be noticed, and not be replaced by the initial state.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model
