"""A robot without its held joints moves as the whole one does while they are held."""

import numpy as np
import pinocchio as pin
import pytest

from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.robots.description import find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model
from aloft.robots.welding import welded

from .example_robots import needs_robots
from .limbed_robots import humanoid

ROBOT = humanoid().changed(held={"waist": 0.4, "left_hip_yaw": 0.3, "right_hip_roll": -0.2})


def test_a_robot_that_holds_nothing_is_itself() -> None:
    robot = find_robot("bruce")
    part = welded(robot)
    assert part.robot is robot
    assert part.moving == tuple(range(10))
    assert (part.held, part.loads) == ((), ())


def test_mass_places_and_motion_are_the_whole_robots() -> None:
    part = welded(ROBOT)
    names = [joint.name for joint in part.robot.joints]
    assert not set(names) & set(ROBOT.held)
    assert part.robot.total_mass == pytest.approx(ROBOT.total_mass, abs=1e-12)
    rng = np.random.default_rng(5)
    base = np.array([0.1, 0.2, 0.9, 0.1, -0.2, 0.3, 0.9])
    base[3:] /= np.linalg.norm(base[3:])
    angles, rates, bends = rng.uniform(-0.8, 0.8, (3, len(names)))
    twist, force = rng.uniform(-1.0, 1.0, 6), rng.uniform(-20.0, 20.0, (8, 3))
    found = []
    for robot, q, v, a in (
        (part.robot, angles, rates, bends),
        (ROBOT, part.expand(angles, held=part.angles), part.expand(rates), part.expand(bends)),
    ):
        dynamics = ExactDynamics(robot)
        q, v = np.concatenate([base, q]), np.concatenate([twist, v])
        com, speed, momentum = dynamics.centroidal(q, v)
        torque = dynamics.joint_torque(q, v, a, force)
        found.append([dynamics.points(q), com, speed, momentum, torque])
    found[1][-1] = part.reduce(found[1][-1])
    for one, other in zip(*found, strict=True):
        assert np.abs(one - other).max() < 1e-10


@needs_robots
@pytest.mark.parametrize("name", ["g1", "simple_humanoid", "talos"])
def test_bodies_are_those_of_pinocchios_reduced_model(name: str) -> None:
    robot = find_robot(name).model_copy(
        update={"feet": (), "contacts": ()}
    )  # no frames but joints'
    whole, own = (build_pinocchio_model(each).model for each in (robot, welded(robot).robot))
    for joint in range(1, whole.njoints):
        whole.addJointFrame(joint)
    q = pin.neutral(whole)
    for joint, value in robot.held.items():
        q[whole.joints[whole.getJointId(joint)].idx_q] = value
    reduced = pin.buildReducedModel(whole, [whole.getJointId(joint) for joint in robot.held], q)
    assert len(robot.held) >= 17 and reduced.njoints == own.njoints
    for k in range(1, own.njoints):
        other = reduced.getJointId(own.names[k])
        ours, theirs = own.inertias[k], reduced.inertias[other]
        np.testing.assert_allclose(ours.matrix(), theirs.matrix(), rtol=0, atol=1e-13)
        ours, theirs = own.jointPlacements[k], reduced.jointPlacements[other]
        np.testing.assert_allclose(ours.homogeneous, theirs.homogeneous, rtol=0, atol=1e-13)


def test_values_of_all_joints_and_back() -> None:
    part = welded(ROBOT)
    values = np.arange(2.0 * len(part.moving)).reshape(2, -1)
    whole = part.expand(values, held=part.angles)
    assert whole.shape == (2, len(ROBOT.joints))
    assert (part.reduce(whole) == values).all()
    held = {ROBOT.joints[k].name: whole[1, k] for k in part.held}
    assert held == pytest.approx(dict(ROBOT.held))


def test_motors_shared_with_joints_that_move_are_refused() -> None:
    robot = find_robot("bruce").changed(held={"left_hip_pitch": 0.4})
    with pytest.raises(ValueError, match="held joints left_hip_pitch share motors"):
        welded(robot)
