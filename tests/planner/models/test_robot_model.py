"""Where a robot stands for given joint angles: on all of its contact points, however many."""

import numpy as np
import pytest
from tests.robots.limbed_robots import quadruped

from aloft.planner.models.robot_model import Stance, model_of
from aloft.planner.task.files import PlanError
from aloft.robots.description import RobotDescription, find_robot


def stand(robot: RobotDescription, heading: float = 0.0, **angles: float) -> Stance:
    standing = dict(robot.standing) | angles
    joints = np.array([standing.get(joint.name, 0.0) for joint in robot.joints])
    return model_of(robot)[1].place(joints, heading=heading, at=(0.1, -0.2, 0.05))


def test_a_quadruped_stands_on_four_balls() -> None:
    stance = stand(quadruped())
    assert np.abs(stance.points[:, 2] - 0.05).max() < 1e-12
    assert np.abs(stance.points.mean(axis=0)[:2] - [0.1, -0.2]).max() < 1e-12
    # The shanks lean, so the balls have rolled away from where they touch at the zero pose.
    assert np.abs(stance.footholds - stance.points)[:, 0].max() > 1e-3


def test_the_base_leans_where_the_hind_legs_are_bent_more() -> None:
    robot = quadruped()
    more = {f"{leg}_hip_pitch": 0.95 for leg in ("back_left", "back_right")}
    more |= {f"{leg}_knee": -1.8 for leg in ("back_left", "back_right")}
    stance = stand(robot, **more)
    assert np.abs(stance.points[:, 2] - 0.05).max() < 1e-6
    assert stance.coordinates[3] < -0.05
    turned = stand(robot, heading=0.7, **more)
    assert np.abs(turned.points[:, 2] - 0.05).max() < 1e-6
    assert turned.com[2] == pytest.approx(stance.com[2], abs=1e-9)


def test_one_leg_that_is_too_short_is_said_with_heights() -> None:
    with pytest.raises(PlanError, match=r"do not lie in one plane.*front_left_0 .*mm"):
        stand(quadruped(), front_left_knee=-2.2)
    try:
        stand(quadruped(), front_left_knee=-2.2)
    except PlanError as error:
        assert error.family == "stance"
        assert "choose angles that put all feet on the ground" in str(error)


def test_nothing_to_stand_on() -> None:
    robot = find_robot("bruce").changed(contacts=())
    with pytest.raises(PlanError, match="bruce has no contact points to stand on"):
        stand(robot)
