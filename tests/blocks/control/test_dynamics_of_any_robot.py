"""The compiled dynamics of every robot with a floating base are Pinocchio's, to 1e-10 of their size."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from aloft.blocks.control.dynamics import Dynamics
from aloft.robots.description import find_robot
from aloft.robots.kinematics import ball_feet
from aloft.robots.pinocchio_model import build_pinocchio_model
from aloft.runtime.testing import BlockBench

from ...robots.example_robots import URDF, needs_robots

NAMES = ["bruce", *(pytest.param(name, marks=needs_robots) for name in URDF)]


def close(found: NDArray[np.float64], expected: Any) -> None:
    size = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * size)


@pytest.mark.parametrize("name", NAMES)
def test_every_term_is_pinocchios(name: str) -> None:
    robot = find_robot(name)
    built = build_pinocchio_model(robot)
    model, balls = built.model, {}
    for ball in ball_feet(robot):
        owner = model.frames[built.contact_frames[ball.point]].parentJoint
        place = pin.SE3(np.eye(3), np.array(ball.centre))
        frame = pin.Frame(f"ball {ball.point}", owner, 0, place, pin.OP_FRAME)
        balls[ball.point] = model.addFrame(frame), ball.radius
    data = model.createData()
    bench = BlockBench(Dynamics, robot=robot)
    random = np.random.default_rng(7)
    for _ in range(3):
        turn = random.normal(size=4)
        angles = random.normal(size=len(robot.joints))
        q = np.concatenate([random.normal(size=3), turn / np.linalg.norm(turn), angles])
        v = random.normal(size=model.nv)
        rotation = pin.Quaternion(q[3:7]).toRotationMatrix()
        bench.set(
            "base", position=q[:3], orientation=q[3:7],
            linear_velocity=rotation @ v[:3], angular_velocity=v[3:6],
        )  # fmt: skip
        bench.set("joints", position=angles, velocity=v[6:])
        bench.step()
        terms = bench.get("terms")

        upper = np.triu(pin.crba(model, data, q))
        close(terms.mass_matrix, upper + np.triu(upper, 1).T + built.rotor_coupling)
        close(terms.nonlinear_effects, pin.nonLinearEffects(model, data, q, v))
        close(terms.centroidal_matrix, pin.ccrba(model, data, q, v))
        close(terms.linear_momentum, data.hg.linear)
        close(terms.angular_momentum, data.hg.angular)
        pin.computeCentroidalMomentumTimeVariation(model, data, q, v, np.zeros(model.nv))
        close(terms.centroidal_drift, data.dhg.vector)
        close(terms.com, pin.centerOfMass(model, data, q))

        aligned = pin.LOCAL_WORLD_ALIGNED
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        for k, frame in enumerate(built.contact_frames):
            below = np.zeros(3)
            if k in balls:  # which rolls about its centre, and touches below it
                frame, below[2] = balls[k][0], -balls[k][1]
            jacobian = pin.getFrameJacobian(model, data, frame, aligned)
            jacobian = jacobian[:3] - pin.skew(below) @ jacobian[3:]
            close(terms.contact_position[k], data.oMf[frame].translation + below)
            close(terms.contact_jacobian[k], jacobian)
            close(terms.contact_velocity[k], jacobian @ v)
            if k not in balls:
                drift = pin.getFrameClassicalAcceleration(model, data, frame, aligned)
                close(terms.contact_drift[k], drift.linear)
        for k, frame in enumerate(built.sole_frames):
            if not balls:
                close(terms.foot_position[k], data.oMf[frame].translation)
            close(terms.foot_rotation[k], data.oMf[frame].rotation)
