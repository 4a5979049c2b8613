"""Fixed and planar bases, slides and inclined axes: our kinematics and Pinocchio's model agree."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from aloft.robots.description import RobotDescription
from aloft.robots.kinematics import link_poses
from aloft.robots.pinocchio_model import build_pinocchio_model

from .validation.wrong_robots import hopper


def robot_on(base: str) -> RobotDescription:
    data = hopper() | {"base_joint": base}
    data["joints"][0] |= {"kind": "slide", "axis": [0.6, 0.0, -0.8]}
    data["joints"][1] |= {"axis": [0.0, 0.8, 0.6]}
    return RobotDescription.model_validate(data)


def base_state(base: str) -> tuple[Any, Any, Any]:
    """Pinocchio's positions of a base, its place and its quaternion x, y, z, w."""
    if base == "fixed":
        return np.zeros(0), np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    if base == "planar":
        x, z, pitch = 0.3, 0.7, 0.4
        quaternion = np.array([0.0, np.sin(pitch / 2), 0.0, np.cos(pitch / 2)])
        return np.array([x, z, pitch]), np.array([x, 0.0, z]), quaternion
    quaternion = np.array([0.1, -0.2, 0.3, 0.9])
    quaternion /= np.linalg.norm(quaternion)
    return np.concatenate([[0.3, 0.2, 0.7], quaternion]), np.array([0.3, 0.2, 0.7]), quaternion


@pytest.mark.parametrize(("base", "velocities"), [("fixed", 0), ("planar", 3), ("floating", 6)])
def test_contact_points_are_at_one_place(base: str, velocities: int) -> None:
    robot = robot_on(base)
    built = build_pinocchio_model(robot)
    assert built.model.nv == robot.dimensions["n_velocities"] == velocities + 2
    positions, place, quaternion = base_state(base)
    angles = np.array([0.15, 0.6])
    data = built.model.createData()
    pin.framesForwardKinematics(built.model, data, np.concatenate([positions, angles]))
    poses = link_poses(robot, place[None], quaternion[None], angles[None])
    origin, turn = poses.of("shank")
    point = origin[0] + turn[0] @ np.array(robot.contacts[0].position)
    np.testing.assert_allclose(data.oMf[built.contact_frames[0]].translation, point, atol=1e-12)
    np.testing.assert_allclose(data.oMf[built.sole_frames[0]].rotation, turn[0], atol=1e-12)


@pytest.mark.parametrize("base", ["fixed", "planar", "floating"])
def test_reflected_rotors_are_behind_the_base(base: str) -> None:
    robot = robot_on(base)
    built = build_pinocchio_model(robot)
    first = robot.base_velocities
    whole = built.rotor_coupling + np.diag(built.model.armature)
    # Two motors of 0.001 kg m^2, the second geared to both joints: [[2, 1], [1, 1]].
    np.testing.assert_allclose(whole[first:, first:], [[0.002, 0.001], [0.001, 0.001]], atol=1e-15)
    assert not whole[:first].any() and not whole[:, :first].any()


def test_a_slide_moves_along_its_axis_only() -> None:
    robot = robot_on("fixed")
    still, upright = np.zeros((2, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 1))
    poses = link_poses(robot, still, upright, np.array([[0.0, 0.0], [0.5, 0.0]]))
    place, turn = poses.of("thigh")
    np.testing.assert_allclose(place[1] - place[0], [0.3, 0.0, -0.4], atol=1e-15)
    np.testing.assert_array_equal(turn[1], turn[0])


def test_another_profile_has_other_rotors() -> None:
    data = hopper()
    data["profiles"]["heavy"] = data["profiles"]["small"] | {"rotor_inertia": 0.01}
    robot = RobotDescription.model_validate(data)
    assert build_pinocchio_model(robot).model.armature[6] == pytest.approx(0.002)
    assert build_pinocchio_model(robot, "heavy").model.armature[6] == pytest.approx(0.02)
    with pytest.raises(LookupError, match="no actuator profile 'light'; there is small, heavy"):
        build_pinocchio_model(robot, "light")
