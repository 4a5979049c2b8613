"""The world that a seed stands for: the values drawn once, and the simulator's model."""

from __future__ import annotations

from collections import deque
from copy import copy
from typing import TYPE_CHECKING, NamedTuple

from ...robots.description import RobotDescription
from .mujoco_model import Variation, build_mujoco_model
from .parameters import SimulatorParameters
from .random_streams import Purpose, stream
from .scenes import Scene

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
    scene = params.build_scene()
    for kept in _kept:
        if kept.robot is robot and kept[1:4] == (scene, params.timestep, variation):
            return copy(kept.model)
    import mujoco

    model = build_mujoco_model(robot, scene=scene, timestep=params.timestep, variation=variation)
    # A state that has become NaN must be noticed, and not be replaced by the initial state.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    _kept.append(_Kept(robot, scene, params.timestep, variation, copy(model)))
    return model


class _Kept(NamedTuple):
    """A model that has been built, and what it was built from."""

    robot: RobotDescription
    scene: Scene
    timestep: float
    variation: Variation
    model: MjModel


_kept: deque[_Kept] = deque(maxlen=4)
"""The models built last. The runs of a study mostly differ by what is not in the model, and building
it takes longer than anything else before a run. Nobody is given the kept model itself."""
