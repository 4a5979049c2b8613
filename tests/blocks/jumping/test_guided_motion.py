"""A guided body moves as it is told: centre of mass, rotation or momentum, and feet."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from aloft.blocks.jumping.guided_motion import GuidedBody, Motion, MotionRecorder
from aloft.robots.description import find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model
from aloft.runtime.language.errors import BlockError

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
    return Motion(**{**values, **changes})


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
    data = BUILT.model.createData()
    pin.computeCentroidalMomentum(BUILT.model, data, q, v)
    pin.centerOfMass(BUILT.model, data, q, v)
    assert data.vcom[0] == pytest.approx(wanted.com_velocity, abs=1e-10)
    for axis in range(3):
        found = data.hg.angular[axis] if by_momentum[axis] else v[3 + axis]
        assert found == pytest.approx(wanted.rotation[axis], abs=1e-10)
    for foot, frame in enumerate(BUILT.sole_frames):
        turn = pin.computeFrameJacobian(
            BUILT.model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
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


def test_a_robot_with_other_legs_is_refused():
    robot = SimpleNamespace(name="tripod", total_mass=1.0)
    built = SimpleNamespace(model=BUILT.model, sole_frames=BUILT.sole_frames[:1])
    with pytest.raises(BlockError, match="tripod: a squat jump is planned for legs of five joints"):
        GuidedBody(built, robot)
