"""Against the description's own chain of joints and numeric derivatives."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from aloft.robots.contact_kinematics import ContactKinematics
from aloft.robots.description import find_robot
from aloft.robots.kinematics import link_poses
from aloft.robots.pinocchio_model import build_pinocchio_model

ROBOT = find_robot("bruce")
SEEN = ContactKinematics(ROBOT)
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
SEEDS = range(6)


def draw(seed):
    random = np.random.default_rng(seed)
    limits = ROBOT.joint_limits
    orientation = random.normal(size=4)
    return (
        orientation / np.linalg.norm(orientation),
        random.normal(size=3) * 3.0,
        random.uniform(limits[:, 0], limits[:, 1]),
        random.normal(size=10) * 5.0,
    )


def chain(joints):
    """Foot origins and rotations in the base's frame."""
    poses = link_poses(ROBOT, np.zeros((1, 3)), UPRIGHT[None], joints[None])
    places, turns = zip(*(poses.of(foot.link) for foot in ROBOT.feet), strict=True)
    return [p[0] for p in places], [t[0] for t in turns]


@pytest.mark.parametrize("seed", SEEDS)
def test_points_are_the_lowest_of_the_round_rubber(seed):
    orientation, rate, joints, speeds = draw(seed)
    SEEN.evaluate(orientation, rate, joints, speeds)
    up = pin.Quaternion(orientation).toRotationMatrix()[2]
    places, turns = chain(joints)
    for point, contact, foot in zip(
        SEEN.points, ROBOT.contacts, ROBOT.foot_of_contact(), strict=True
    ):
        centre = places[foot] + turns[foot] @ (
            np.array(contact.position) + np.array([0.0, 0.0, contact.radius])
        )
        assert np.linalg.norm(point - centre) == pytest.approx(contact.radius)
        assert point == pytest.approx(centre - contact.radius * up)


def test_flat_feet_touch_where_the_description_says():
    joints = ROBOT.standing_position
    SEEN.evaluate(UPRIGHT, np.zeros(3), joints, np.zeros(10))
    places, turns = chain(joints)
    for point, contact, foot in zip(
        SEEN.points, ROBOT.contacts, ROBOT.foot_of_contact(), strict=True
    ):
        assert point == pytest.approx(places[foot] + turns[foot] @ np.array(contact.position))
    for sole, place, turn, foot in zip(SEEN.soles, places, turns, ROBOT.feet, strict=True):
        assert sole == pytest.approx(place + turn @ np.array(foot.sole))
    assert not SEEN.rates.any()
    assert SEEN.forward == pytest.approx([2.0, 0.0, 0.0])


@pytest.mark.parametrize("seed", SEEDS)
def test_rates_are_those_of_the_material_points(seed):
    """The joints' part as a numeric derivative of a point fixed to the foot, plus w x r."""
    orientation, rate, joints, speeds = draw(seed)
    SEEN.evaluate(orientation, rate, joints, speeds)
    step = 1e-6
    places, turns = chain(joints)
    before, after = chain(joints - step * speeds), chain(joints + step * speeds)
    for point, found, foot in zip(SEEN.points, SEEN.rates, ROBOT.foot_of_contact(), strict=True):
        arm = turns[foot].T @ (point - places[foot])
        moved = [place[foot] + turn[foot] @ arm for place, turn in (before, after)]
        expected = (moved[1] - moved[0]) / (2 * step) + np.cross(rate, point)
        assert np.abs(found - expected).max() < 1e-7


@pytest.mark.parametrize("seed", SEEDS)
def test_com_velocity_is_pinocchios(seed):
    orientation, rate, joints, speeds = draw(seed)
    SEEN.evaluate(orientation, rate, joints, speeds)
    model = build_pinocchio_model(ROBOT).model
    data = model.createData()
    q = np.r_[np.zeros(3), UPRIGHT, joints]
    pin.centerOfMass(model, data, q, np.r_[np.zeros(3), rate, speeds])
    assert np.abs(SEEN.com_velocity - data.vcom[0]).max() < 1e-13


@pytest.mark.parametrize("seed", SEEDS)
def test_jacobians_of_the_centres_of_the_rubber(seed):
    orientation, rate, joints, speeds = draw(seed)
    up = pin.Quaternion(orientation).toRotationMatrix()[2]

    def centres(at):
        SEEN.evaluate(orientation, rate, at, speeds)
        SEEN.differentiate()
        return SEEN.centres.copy()

    found = centres(joints), SEEN.jacobians.copy(), SEEN.points.copy()
    radius = np.array([[contact.radius] for contact in ROBOT.contacts])
    np.testing.assert_allclose(found[2], found[0] - radius * up, atol=1e-12)
    for joint in range(10):
        step = np.zeros(10)
        step[joint] = 1e-6
        numeric = (centres(joints + step) - centres(joints - step)) / 2e-6
        np.testing.assert_allclose(found[1][:, :, joint], numeric, atol=1e-8)
