"""Frames of the robot against differences of their places, for links, named points and contacts."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aloft.blocks.control.frames import FrameModel, frames_of
from aloft.blocks.signals import DynamicsTerms, JointState
from aloft.mathematics.rotations import exponential, to_matrix
from aloft.robots.description import find_robot

ROBOT = find_robot("go2")
RANDOM = np.random.default_rng(3)
N = 6 + len(ROBOT.joints)


class Model:
    """A frame model whose inputs are arrays."""

    def __init__(self, name, offset):
        signals = {
            "terms": SimpleNamespace(
                base_position=np.zeros(3), base_rotation=np.eye(3), velocity=np.zeros(N)
            ),
            "joints": SimpleNamespace(position=np.zeros(N - 6)),
        }
        self.terms, self.joints = signals["terms"], signals["joints"]
        frames = FrameModel(ROBOT, self.terms, self.joints)
        self.frame, self.calls = frames.frame(name, offset), frames.calls
        assert frames.frame(name, offset) is self.frame and len(frames.calls) == 2

    def update(self, pose, velocity):
        """Of the pose (position, rotation, joints) and the generalised velocity."""
        self.terms.base_position[:], self.terms.base_rotation[:], self.joints.position[:] = pose
        self.terms.velocity[:] = velocity
        for call in self.calls:
            call.run()


def moved(pose, velocity, dt):
    """The pose after a short time at a constant generalised velocity, by many small steps."""
    position, rotation, joints = (np.array(each) for each in pose)
    turn, quaternion = np.zeros((3, 3)), np.zeros(4)
    for _ in range(20):
        position += rotation @ velocity[:3] * dt / 20
        exponential(velocity[3:6] * dt / 20, quaternion)
        to_matrix(quaternion, turn)
        rotation = rotation @ turn
        joints += velocity[6:] * dt / 20
    return position, rotation, joints


@pytest.mark.parametrize(
    ("name", "offset"),
    [("FL_calf", (0.0, 0.0, 0.0)), ("FR_thigh", (0.1, -0.05, 0.2)), (ROBOT.base, (0.3, 0.0, 0.1))],
)
def test_velocity_jacobian_and_drift_are_derivatives(name, offset):
    model = Model(name, offset)
    quaternion, rotation = RANDOM.normal(size=4), np.zeros((3, 3))
    to_matrix(quaternion / np.linalg.norm(quaternion), rotation)
    pose = RANDOM.normal(size=3), rotation, RANDOM.uniform(-1.0, 1.0, N - 6)
    velocity, dt = RANDOM.normal(size=N), 1e-4
    found = []
    for t in (-dt, dt):
        model.update(moved(pose, velocity, t), velocity)
        found.append(
            (model.frame.position.copy(), model.frame.rotation.copy(), model.frame.velocity.copy())
        )
    model.update(pose, velocity)
    frame = model.frame
    assert frame.velocity == pytest.approx(frame.jacobian @ velocity)
    (before, turned_before, rate_before), (after, turned_after, rate_after) = found
    assert frame.velocity[:3] == pytest.approx((after - before) / (2.0 * dt), abs=1e-4)
    spin = (turned_after - turned_before) / (2.0 * dt) @ frame.rotation.T
    assert frame.velocity[3:] == pytest.approx([spin[2, 1], spin[0, 2], spin[1, 0]], abs=1e-4)
    assert frame.drift == pytest.approx((rate_after - rate_before) / (2.0 * dt), abs=2e-3)


def test_frames_are_links_named_points_and_contact_points():
    frames = frames_of(ROBOT)
    assert frames["FL_calf"] == ("FL_calf", (0.0, 0.0, 0.0))
    contact = ROBOT.contacts[0]
    assert frames[contact.name][1] == contact.position
    assert set(ROBOT.points) <= set(frames)
    with pytest.raises(KeyError):
        FrameModel(ROBOT, SimpleNamespace(), SimpleNamespace()).frame("tail")


def test_the_kernels_take_the_signals_they_name():
    assert {"base_position", "base_rotation", "velocity"} <= set(DynamicsTerms.fields)
    assert "position" in JointState.fields
