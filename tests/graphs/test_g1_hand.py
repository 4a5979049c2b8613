"""G1 stands while its hand follows a circle, and so does a foot of Go2 by a user's own task."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.mathematics.rotations import to_matrix
from aloft.robots.description import find_robot
from aloft.robots.kinematics import link_poses_in_base

GRAPHS = Path(aloft.__file__).parent / "graphs"


def place_of(link, robot, joints, position, orientation):
    """Where a link's origin is in the world."""
    rotation = np.zeros((3, 3))
    to_matrix(orientation, rotation)
    poses = link_poses_in_base(robot, joints)
    return position + rotation @ poses[link][1]


@pytest.mark.long
def test_the_hand_of_a_standing_g1_follows_a_circle():
    """Within 15 mm of the target in the simulator's truth, and within 10 mm in the last second."""
    result = aloft.load(GRAPHS / "robots" / "g1_hand.yaml").run()
    assert result.success, result.reason
    assert result.metrics["qp_failures"] == 0
    robot, target = find_robot("g1"), result.signal("hand.target.position")
    assert np.ptp(target, axis=0).max() > 0.095  # a whole circle of 5 cm
    joints = result.signal("robot.truth.joint_position")
    positions = result.signal("robot.truth.base_position")
    orientations = result.signal("robot.truth.base_orientation")
    errors = np.array(
        [
            np.linalg.norm(place_of("left_wrist_yaw_link", robot, q, p, o) - r)
            for q, p, o, r in zip(joints, positions, orientations, target, strict=True)
        ]
    )
    assert errors.max() < 0.015
    assert errors[-500:].max() < 0.010


OWN = '''
from aloft.blocks.control.tasks import FeedbackGains, FeedbackTask, TaskError, TaskJacobian
from aloft.blocks.signals import PointTarget
from aloft.blocks.control.frames import Frame
from aloft.mathematics.kernel import kernel
from aloft.runtime.language.block import Input


class Height(FeedbackTask):
    """The height of the torso."""

    size = 1
    target = Input(PointTarget, text="how high")

    def setup(self):
        self.frame = self.model.frame(self.robot.base)

    @kernel
    @staticmethod
    def error(frame: Frame, target: PointTarget, e: TaskError) -> None:
        e.value[0] = target.position[2] - frame.position[2]
        e.rate[0] = target.velocity[2] - frame.velocity[2]
        e.feedforward[0] = target.acceleration[2]

    @kernel
    @staticmethod
    def jacobian(frame: Frame, j: TaskJacobian) -> None:
        j.matrix[0, :] = frame.jacobian[2, :]
        j.drift[0] = frame.drift[2]
'''
GRAPH = """
robot: go2
include: [GRAPHS/robots/stand.yaml]
set:
  push.speed_change: 0
  wbc.tasks:
    - ContactPoints
    - TorsoOrientation
    - AngularMomentum
    - LinearMomentum
    - {task: "own:Height", name: torso, gains: {weight: 3000, stiffness: 400, damping: 40}}
wires: {wbc.torso_target: circle.target}
blocks:
  circle:
    use: blocks.CircleTarget
    with: {centre: [0.0, 0.0, HEIGHT], axis: y, radius: 20 mm, start: 0.3 s, growth: 0.3 s}
"""


@pytest.mark.long
def test_a_users_task_with_an_input_of_its_own_lies_beside_the_graph(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    robot = find_robot("go2")
    still = aloft.load(GRAPHS / "robots" / "go2_stand.yaml").run(duration=0.1)
    height = float(still.signal("estimator.base.position")[0, 2])
    text = GRAPH.replace("GRAPHS", str(GRAPHS)).replace("HEIGHT", str(height))
    (tmp_path / "own.yaml").write_text(text)
    result = aloft.load(tmp_path / "own.yaml").run(duration=1.5)
    assert result.metrics["qp_failures"] == 0 and robot.base
    reference = result.signal("circle.target.position")[:, 2]
    found = result.signal("estimator.base.position")[:, 2]
    assert np.ptp(reference) > 0.03
    assert np.abs(found - reference).max() < 0.012
    unwired = text.replace("wires: {wbc.torso_target: circle.target}\n", "")
    (tmp_path / "unwired.yaml").write_text(unwired)
    with pytest.raises(Exception, match="torso_target"):
        aloft.load(tmp_path / "unwired.yaml")
