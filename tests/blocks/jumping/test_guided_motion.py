"""A guided body moves as it is told: centre of mass, rotation or momentum, and feet."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from aloft.blocks.jumping.guided_motion import (
    GuidedBody,
    GuidedMotion,
    MotionRecorder,
    check_limits,
)
from aloft.robots.description import find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model
from aloft.runtime.language.errors import BlockError

from ...robots.limbed_robots import SEVEN_JOINTS, humanoid, quadruped

ROBOT = find_robot("bruce")
BUILT = build_pinocchio_model(ROBOT)


@pytest.fixture
def body():
    return GuidedBody(BUILT, ROBOT)


def motion(**changes):
    values = {
        "com": np.zeros(3), "com_velocity": np.zeros(3), "com_acceleration": np.zeros(3),
        "rotation": np.zeros(3), "rotation_rate": np.zeros(3),
        "by_momentum": (False, False, False), "foot_velocity": np.zeros((2, 3)),
    }  # fmt: skip
    return GuidedMotion(**{**values, **changes})


def moved(built, q, wanted, v, tolerance):
    """Check centre of mass and rotation; gives the Jacobian of every sole."""
    data = built.model.createData()
    pin.computeCentroidalMomentum(built.model, data, q, v)
    pin.centerOfMass(built.model, data, q, v)
    assert data.vcom[0] == pytest.approx(wanted.com_velocity, abs=tolerance)
    for axis in range(3):
        found = data.hg.angular[axis] if wanted.by_momentum[axis] else v[3 + axis]
        assert found == pytest.approx(wanted.rotation[axis], abs=tolerance)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    return [
        pin.computeFrameJacobian(built.model, data, q, frame, world) for frame in built.sole_frames
    ]


@pytest.mark.parametrize(
    "by_momentum", [(False, False, False), (False, True, False), (True, True, True)]
)
def test_the_velocity_is_the_one_asked_for(body, by_momentum):
    q = body.standing(ROBOT.standing_position)
    wanted = motion(
        com_velocity=np.array([0.1, -0.05, 0.4]),
        rotation=np.array([0.01, 0.02, -0.01]),
        by_momentum=by_momentum,
        foot_velocity=np.array([[0.0, 0.0, 0.3], [0.1, 0.0, 0.0]]),
    )
    v = body.velocity(q, wanted)
    for foot, turn in enumerate(moved(BUILT, q, wanted, v, 1e-10)):
        assert turn[:3] @ v == pytest.approx(wanted.foot_velocity[foot], abs=1e-10)
        assert turn[4:] @ v == pytest.approx(np.zeros(2), abs=1e-10)


def test_standing_puts_the_middle_of_the_soles_at_the_origin(body):
    feet = body.feet(body.standing(ROBOT.standing_position))
    assert feet.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


def test_a_motion_is_followed_to_its_end(body):
    """Sinking by 3 cm and leaning by 0.2 rad at constant rates, the feet at rest."""
    recorder = MotionRecorder(body, body.standing(ROBOT.standing_position))
    start, feet = body.com(recorder.q), body.feet(recorder.q)
    down = np.array([0.0, 0.0, -0.3])
    recorder.run(0.1, lambda t: motion(com_velocity=down, rotation=np.array([0.0, 2.0, 0.0])))
    assert body.com(recorder.q) == pytest.approx(start + 0.1 * down, abs=1e-7)
    assert body.pitch(recorder.q) == pytest.approx(0.2, abs=1e-7)
    assert body.feet(recorder.q) == pytest.approx(feet, abs=1e-7)
    assert recorder.time[0] == 0.0
    assert recorder.time[-1] == pytest.approx(0.1)
    assert len(recorder.rows["joint_position"]) == len(recorder.time)


def test_a_robot_with_too_few_joints_is_refused():
    robot = quadruped()
    held = robot.model_copy(update={"held": {"front_left_knee": -1.5, "back_right_knee": -1.5}})
    with pytest.raises(
        BlockError, match="feet on the ground fix 2 velocities more than its joints"
    ):
        GuidedBody(build_pinocchio_model(held), held)


def test_stretched_legs_are_refused():
    robot = quadruped()
    body = GuidedBody(build_pinocchio_model(robot), robot)
    up = motion(com_velocity=np.array([0.0, 0.0, 0.1]), foot_velocity=np.zeros((4, 3)))
    with pytest.raises(BlockError, match="quadruped: in this pose its legs cannot move its centre"):
        body.velocity(body.standing(np.zeros(len(robot.joints))), up)


@pytest.mark.parametrize(
    "robot", [quadruped(), humanoid(), humanoid(SEVEN_JOINTS)], ids=["four", "two", "redundant"]
)
@pytest.mark.parametrize("by_momentum", [(False, False, False), (False, True, False)])
@pytest.mark.parametrize("flying", [False, True])
def test_any_body_moves_as_asked(robot, by_momentum, flying):
    built = build_pinocchio_model(robot)
    body = GuidedBody(built, robot)
    q = body.standing(robot.standing_position)
    feet = np.tile([0.1, -0.05, 0.2], (len(robot.feet), 1))
    wanted = motion(
        com_velocity=np.array([0.1, -0.05, 0.4]),
        rotation=np.array([0.01, 0.02, -0.01]),
        by_momentum=by_momentum,
        foot_velocity=feet,
        flying=flying,
    )
    v = body.velocity(q, wanted)
    for foot, turn in enumerate(moved(built, q, wanted, v, 1e-9)):
        speed = (body.feet(body.integrate(q, 1e-6 * v)) - body.feet(q))[foot] / 1e-6
        rolled = np.zeros(3)
        if robot.name == "humanoid":
            assert turn[3:] @ v == pytest.approx(np.zeros(3), abs=1e-9)
        elif not flying:  # the contact moves along below the ball's centre
            rolled = 0.005 * np.cross(turn[3:] @ v, [0.0, 0.0, 1.0])
        assert speed == pytest.approx(feet[foot] + rolled, abs=1e-5)
    names = [joint.name for joint in robot.joints]
    for name, angle in robot.held.items():
        assert v[6 + names.index(name)] == pytest.approx(0.0, abs=1e-12)
        assert q[7 + names.index(name)] == angle


def test_a_line_foot_that_points_aside_may_only_roll():
    """A biped whose line feet point 0.4 rad to the left."""
    turned = [c.model_copy(update={"position": (
        c.position[0] * np.cos(0.4), c.position[0] * np.sin(0.4), c.position[2]
    )}) for c in ROBOT.contacts]  # fmt: skip
    robot = ROBOT.model_copy(update={"contacts": tuple(turned)})
    built = build_pinocchio_model(robot)
    body = GuidedBody(built, robot)
    q = body.standing(robot.standing_position)
    v = body.velocity(q, motion(com_velocity=np.array([0.05, 0.1, 0.2])))
    line = np.array([np.cos(0.4), np.sin(0.4), 0.0])
    data = built.model.createData()
    for frame in built.sole_frames:
        turn = pin.computeFrameJacobian(
            built.model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        assert np.cross(turn[3:] @ v, line) == pytest.approx(np.zeros(3), abs=1e-9)


def test_a_motion_beyond_limits_or_speeds_is_refused_by_name():
    columns = {"joint_position": np.zeros((2, 10)), "joint_velocity": np.zeros((2, 10))}
    columns["joint_position"][:] = ROBOT.standing_position
    check_limits(ROBOT, columns)
    columns["joint_velocity"][1, 5] = 40.0
    with pytest.raises(BlockError, match=r"turns .* at 40.0 rad/s, but koala reaches 30.0 rad/s"):
        check_limits(ROBOT, columns)
    columns["joint_position"][1, 3] = 0.2
    with pytest.raises(
        BlockError, match=r"takes right_knee 0.220 rad past its limit; ask for less"
    ):
        check_limits(ROBOT, columns)
