"""The joint torques that hold a robot on a fixed base against gravity."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...robots.pinocchio_model import build_pinocchio_model
from ...runtime.language.block import Block, Context, Input, Output, UnmetRequirement
from ...runtime.language.parameters import Parameters
from ..signals import JointState, JointTorque


class GravityCompensation(Block):
    """The joint torques g(q) that balance gravity at the measured joint positions, by Pinocchio.

    With these torques alone a robot at rest stays at rest. For a slide the torque is the force
    along its axis. It is computed also for joints without a motor, whose drives cannot produce it.
    The block compensates neither friction nor a load that the robot carries; add a load as a link
    to the robot's description.

    It needs a fixed base: the torques that hold up a robot with a floating base depend on its
    contacts, and the whole-body controller computes them.
    """

    needs = ("robot",)

    joints = Input(JointState, text="measured joint positions")
    torque = Output(JointTorque, text="torques that hold the robot still")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a base that is not fixed."""
        robot = context.robot
        if robot is not None and robot.base_joint != "fixed":
            yield UnmetRequirement(
                f"it needs a robot on a fixed base; {robot.name} has a {robot.base_joint} one",
                fix="use: blocks.WholeBodyController",
            )

    def setup(self) -> None:
        """Build the model."""
        import pinocchio

        self._model: Any = build_pinocchio_model(self.robot).model
        self._data: Any = self._model.createData()
        self._evaluate: Any = pinocchio.computeAllTerms
        self._position = np.array(pinocchio.neutral(self._model))
        self._still = np.zeros(self._model.nv)
        self._gravity = self._data.nle  # Pinocchio's own memory, written in every evaluation

    def step(self) -> None:
        """Evaluate the model at rest in the measured position."""
        self._position[:] = self.joints.position
        # The function for gravity alone returns it as a new array.
        self._evaluate(self._model, self._data, self._position, self._still)
        self.torque.torque[:] = self._gravity
