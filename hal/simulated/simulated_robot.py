"""What every robot that MuJoCo simulates has beside a real one's ports: truth, a push, a floor."""

from __future__ import annotations

from abc import ABC
from collections.abc import Mapping

from ...blocks.signals import ExternalForce, RobotTruth
from ...robots.description import RobotDescription
from ...runtime.language.block import Input, Output, State
from ...runtime.language.parameters import Parameters
from ...runtime.language.terrain import Terrain
from ..robot import Robot
from .parameters import SimulatorParameters
from .state import PhysicsState


class SimulatedRobot(Robot, ABC):
    """The ports and the surroundings of a simulated robot; see ``MujocoRobot`` and ``TwinRobot``."""

    outside = "simulated"

    push = Input(ExternalForce, default={}, text="a force from outside, held for the tick")
    truth = Output(RobotTruth, truth=True, text="what only a simulator knows")
    physics = State(PhysicsState, text="the simulator's state, written for a snapshot")

    @classmethod
    def terrain(cls, params: Parameters) -> Terrain | None:
        """The scene's floor and boxes."""
        assert isinstance(params, SimulatorParameters)
        return params.build_scene().terrain()

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """The number of named points that a force may act at; the seed is not a dimension."""
        return {"n_points": len(robot.points) if robot is not None else 0}
