"""The joints' rows against their equation, and for which joints there are any."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aloft.blocks.control.tasks.posture import (
    Posture,
    PostureParameters,
    chosen_joints,
)
from aloft.blocks.control.tasks.task import TaskError, TaskJacobian, feedback_rows
from aloft.blocks.control.whole_body_controller import WholeBodyController
from aloft.mathematics.whole_body_qp import TaskRows
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

BRUCE = find_robot("bruce")
RANDOM = np.random.default_rng(7)


def test_a_joint_accelerates_by_feedforward_and_feedback():
    index = np.array([1, 4, 2])
    position, velocity = RANDOM.normal(size=5), RANDOM.normal(size=11)
    reference = RANDOM.normal(size=(3, 5))
    target = SimpleNamespace(
        joint_position=reference[0], joint_velocity=reference[1], joint_acceleration=reference[2]
    )
    terms, joints = SimpleNamespace(velocity=velocity), SimpleNamespace(position=position)
    rows = TaskRows(np.ones((3, 11)), np.zeros(3), np.zeros(3))
    gains = (np.array([2.0, 3.0, 4.0]), np.full(3, 100.0), np.full(3, 20.0))
    e, j = TaskError(*np.zeros((3, 3))), TaskJacobian(rows.jacobian, np.zeros(3))
    Posture.error(terms, joints, target, index, e)
    Posture.jacobian(joints, index, j)
    feedback_rows(e, j.drift, *gains, rows)
    assert (rows.jacobian == np.eye(11)[[7, 10, 8]]).all()
    angle, rate, feedforward = reference[:, index]
    assert rows.desired == pytest.approx(
        feedforward + 100.0 * (angle - position[index]) + 20.0 * (rate - velocity[[7, 10, 8]])
    )
    assert rows.weights.tolist() == [2.0, 3.0, 4.0]


def test_by_default_it_is_for_joints_of_no_leg_and_held_ones():
    assert chosen_joints(BRUCE, PostureParameters()) == []
    held = BRUCE.changed(held={"left_hip_yaw": 0.1})
    assert chosen_joints(held, PostureParameters()) == [5]


def test_weights_go_by_pattern():
    robot = BRUCE
    params = PostureParameters(
        joints=["left_hip_*"], posture_weight={"*": 1.0, "*_yaw": 3.0}, posture_stiffness=50.0
    )
    names = [robot.joints[joint].name for joint in chosen_joints(robot, params)]
    n = len(names)
    task = SimpleNamespace(
        params=params, robot=robot, rows=SimpleNamespace(desired=np.zeros(n)),
        weight=np.zeros(n), stiffness=np.zeros(n), damping=np.zeros(n),
    )  # fmt: skip
    Posture.setup(task)
    Posture.prepare(task)
    assert n > 1 and "left_hip_yaw" in names
    for row, name in enumerate(names):
        assert task.weight[row] == (3.0 if name.endswith("_yaw") else 1.0)
    assert task.stiffness.tolist() == [50.0] * n


def test_a_pattern_that_matches_no_joint_is_an_unmet_requirement():
    entry = {"task": "Posture", "gains": {"joints": ["*_ankle", "tail"]}}
    with pytest.raises(BlockError, match="task Posture: no joint of bruce is called 'tail'; there"):
        BlockBench(WholeBodyController, {"tasks": [entry]}, robot=BRUCE)
    assert not list(
        Posture.unmet_requirements(PostureParameters(posture_weight={"*_knee": 1.0}), BRUCE)
    )


def test_patterns_choose_joints_in_the_robots_order():
    choice = PostureParameters(joints=["left_knee", "*_ankle"])
    assert chosen_joints(BRUCE, choice) == [4, 8, 9]
