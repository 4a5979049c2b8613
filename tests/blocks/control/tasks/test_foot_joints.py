"""Which joints belong to a leg, and which of them a foot rolls with."""

from __future__ import annotations

from aloft.blocks.control.tasks.foot_joints import leg_joints, rolling_joint
from aloft.robots.description import find_robot

BRUCE = find_robot("bruce")


def test_a_leg_is_listed_from_the_base_outwards():
    assert leg_joints(BRUCE, 0) == (0, 1, 2, 3, 4)
    assert leg_joints(BRUCE, 1) == (5, 6, 7, 8, 9)


def test_a_line_foot_rolls_with_its_ankle():
    assert [rolling_joint(BRUCE, foot) for foot in (0, 1)] == [4, 9]


def test_a_point_foot_does_not_roll():
    toes = [contact for contact in BRUCE.contacts if contact.name.endswith("toe")]
    points = BRUCE.changed(contacts=tuple(toes))
    assert [rolling_joint(points, foot) for foot in (0, 1)] == [None, None]


def test_an_ankle_that_ends_in_a_roll_axis_rolls_with_the_pitch_axis_before_it():
    joints = list(BRUCE.joints)
    joints[4] = joints[4].model_copy(update={"axis": (1.0, 0.0, 0.0)})
    sideways = BRUCE.changed(joints=tuple(joints))
    assert rolling_joint(sideways, 0) == 3
