"""The joints' rows against their equation, and for which joints there are any."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.tasks.posture import (
    Feedback,
    JointTargets,
    Posture,
    PostureChoice,
    chosen_joints,
    posture_rows,
)
from aloft.blocks.control.whole_body_controller import WholeBodyController
from aloft.mathematics.whole_body_qp import TaskRows
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

BRUCE = find_robot("bruce")
RANDOM = np.random.default_rng(7)


def test_a_joint_accelerates_by_feedforward_and_feedback():
    joints = np.array([1, 4])
    position, velocity = RANDOM.normal(size=5), RANDOM.normal(size=11)
    reference = JointTargets(*RANDOM.normal(size=(3, 2)))
    rows = TaskRows(np.ones((2, 11)), np.zeros(2), np.zeros(2))
    gains = Feedback(np.array([2.0, 3.0]), 100.0, 20.0)
    posture_rows(joints, position, velocity, reference, gains, rows)
    assert (rows.jacobian == np.eye(11)[[7, 10]]).all()
    assert rows.desired == pytest.approx(
        reference.acceleration
        + 100.0 * (reference.position - position[joints])
        + 20.0 * (reference.velocity - velocity[[7, 10]])
    )
    assert rows.weights.tolist() == [2.0, 3.0]


def test_by_default_it_is_for_joints_of_no_leg_and_held_ones():
    assert chosen_joints(BRUCE, PostureChoice()) == []
    held = BRUCE.changed(held={"left_hip_yaw": 0.1})
    assert chosen_joints(held, PostureChoice()) == [5]


def test_a_pattern_that_matches_no_joint_is_a_misfit():
    entry = {"task": "Posture", "gains": {"joints": ["*_ankle", "tail"]}}
    with pytest.raises(BlockError, match="task Posture: no joint of bruce is called 'tail'; there"):
        BlockBench(WholeBodyController, {"tasks": [entry]}, robot=BRUCE)
    assert not list(Posture.misfits(BRUCE, PostureChoice(posture_weight={"*_knee": 1.0})))


def test_patterns_choose_joints_in_the_robots_order():
    choice = PostureChoice(joints=["left_knee", "*_ankle"])
    assert chosen_joints(BRUCE, choice) == [4, 8, 9]
