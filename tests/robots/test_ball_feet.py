"""Feet that are balls: found by their one contact point, seen the same by everybody."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.robots.ball_feet import ball_feet
from aloft.robots.contact_kinematics import ContactKinematics
from aloft.robots.description import find_robot
from aloft.robots.link_poses import link_poses, standing_heights

from .limbed_robots import humanoid, quadruped


def test_only_feet_with_one_contact_point_are_balls():
    robot = quadruped()
    assert [ball.foot for ball in ball_feet(robot)] == [0, 1, 2, 3]
    assert ball_feet(humanoid()) == ()
    assert ball_feet(find_robot("bruce")) == ()
    ball, contact = ball_feet(robot)[2], robot.contacts[2]
    assert (ball.point, ball.radius) == (2, contact.radius)
    assert ball.centre.tolist() == np.add(contact.position, (0.0, 0.0, contact.radius)).tolist()


def test_the_lowest_point_is_below_the_centre_for_everybody():
    robot, upright = quadruped(), np.array([0.0, 0.0, 0.0, 1.0])
    poses, n = link_poses(robot, robot.standing_position), len(robot.joints)
    seen = ContactKinematics(robot)
    seen.evaluate(upright, np.zeros(3), robot.standing_position, np.zeros(n))
    for ball in ball_feet(robot):
        turn, place = poses[robot.feet[ball.foot].link]
        lowest = place + turn @ ball.centre - [0, 0, ball.radius]
        assert seen.points[ball.point] == pytest.approx(lowest, abs=1e-12)
        assert seen.soles[ball.foot] == pytest.approx(lowest, abs=1e-12)
        assert standing_heights(robot)[ball.point] == pytest.approx(lowest[2], abs=1e-8)
    assert seen.forward / np.linalg.norm(seen.forward) == pytest.approx([1, 0, 0], abs=1e-6)


def test_the_pattern_of_the_feet_turns_with_the_robot():
    """The direction is seen from the base: turning the legs under it turns the direction."""
    robot, seen = quadruped(), ContactKinematics(quadruped())
    position = robot.standing_position
    upright = np.array([0.0, 0.0, 0.0, 1.0])
    seen.evaluate(upright, np.zeros(3), position, np.zeros(len(position)))
    before = seen.points.copy()
    angle = 0.2
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for point, place in enumerate(before):
        seen.points[point, :2] = turn @ place[:2]
    pattern = seen._pattern
    ahead = pattern[0] @ seen.points + np.cross([0, 0, -1.0], pattern[1] @ seen.points)
    assert np.arctan2(ahead[1], ahead[0]) == pytest.approx(angle, abs=1e-6)
