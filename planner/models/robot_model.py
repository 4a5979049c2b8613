"""The robot's symbolic model, made once."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...robots.description import RobotDescription
from ...robots.welding import HeldLoad, welded
from ..task.errors import PlanError
from .stance import StanceFinder
from .symbolic_model import SymbolicModel
from .symmetry import mirrored_pairs, symmetrised

HARD, HARD_TURN = 40.0, 100.0
"""m/s^2 and rad/s^2 of a link in a hard jump, gravity included."""
MATTERS = 0.5
"""Held joints that need less than this share of their motors in such a motion have no constraint."""


def model_of(robot: RobotDescription) -> tuple[SymbolicModel, StanceFinder]:
    """The model of a robot without its held joints, with the actuator profile in use, and what
    places it on the ground.

    Raises:
        PlanError: held joints share motors with others.
    """
    return _model(robot.model_dump_json(), False)


def symmetric_model_of(robot: RobotDescription) -> tuple[SymbolicModel, StanceFinder]:
    """The same of the robot made exactly the same left and right, where it nearly is; else of the
    robot as it is.

    Raises:
        PlanError: held joints share motors with others.
    """
    return _model(robot.model_dump_json(), True)


@lru_cache(maxsize=8)
def _model(text: str, symmetric: bool) -> tuple[SymbolicModel, StanceFinder]:
    try:
        part = welded(RobotDescription.model_validate_json(text))
    except ValueError as error:
        raise PlanError(str(error), family="stance") from error
    robot, loads = part.robot, [load for load in part.loads if _matters(load)]
    pairs = mirrored_pairs(robot) if symmetric else None
    model = SymbolicModel(symmetrised(robot, pairs) if pairs else robot, loads)
    return model, StanceFinder(model, pairs or ())


def _matters(load: HeldLoad) -> bool:
    """Whether a hard jump could need a good part of what the joint's motor can hold."""
    arm = np.linalg.norm(np.array(load.com) - np.array(load.origin))
    torque = load.mass * arm * HARD + max(load.inertia[:3]) * HARD_TURN
    return bool(torque > MATTERS * load.most)
