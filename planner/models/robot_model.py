"""The robot's symbolic model, made once."""

from __future__ import annotations

from functools import lru_cache

from ...robots.description import RobotDescription
from ..task.errors import PlanError
from .stance import StanceFinder
from .symbolic_model import SymbolicModel


def model_of(robot: RobotDescription, profile: str) -> tuple[SymbolicModel, StanceFinder]:
    """The model with the rotors of that actuator profile, and what places it on the ground.

    Raises:
        PlanError: the robot has no such profile.
    """
    if profile not in robot.profiles:
        raise PlanError(
            f"{robot.name} has no actuator profile {profile!r}; there is "
            + ", ".join(robot.profiles),
            family="motor torque",
        )
    return _model(robot.model_dump_json(), profile)


@lru_cache(maxsize=4)
def _model(text: str, profile: str) -> tuple[SymbolicModel, StanceFinder]:
    model = SymbolicModel(RobotDescription.model_validate_json(text), profile)
    return model, StanceFinder(model)
