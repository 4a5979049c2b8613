"""A model that is right explains every phase; what is wrong with it is seen in the phase and at the joint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aloft.extensions.commissioning.identification.calibration import Calibration, Value
from aloft.extensions.commissioning.identification.identification import MeasuredRun
from aloft.extensions.commissioning.identification.phase_residuals import phase_residuals
from aloft.robots.description import find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model

ROBOT = find_robot("bruce")
PERIOD = 0.002
STANDS, FLIES = 0, 3
NAMES = {STANDS: "stand", FLIES: "flight", 5: "recover"}
TICKS = 600
FLIGHT = slice(400, 600)
JUDGED = {"force", "moment", *(joint.name for joint in ROBOT.joints)}


def exact() -> Calibration:
    """The robot as it is described, and an IMU at its origin."""
    zero, one = Value(value=0.0, std=0.0), Value(value=1.0, std=0.0)
    names = [joint.name for joint in ROBOT.joints]
    return Calibration(
        robot="bruce", friction=dict.fromkeys(names, zero), damping=dict.fromkeys(names, zero),
        torque_constant=dict.fromkeys(ROBOT.transmission.motors, one), saturation=zero,
        load_friction=zero, rotor_inertia=one, mass=Value(value=ROBOT.total_mass, std=0.0),
        imu_position=(zero, zero, zero), imu_rotation=(zero, zero, zero), gyro_age=zero,
        accelerometer_age=zero, velocity_age=zero, play=dict.fromkeys(names, zero),
    )  # fmt: skip


def run() -> tuple[MeasuredRun, np.ndarray]:
    """Standing with the torques that carry the robot, then falling freely, at rest in its joints."""
    import pinocchio as pin

    built = build_pinocchio_model(ROBOT)
    data = built.model.createData()
    q = np.concatenate([[0.0] * 6, [1.0], ROBOT.standing_position])
    weight = pin.computeGeneralizedGravity(built.model, data, q).copy()
    pin.computeJointJacobians(built.model, data, q)
    pin.updateFramePlacements(built.model, data)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    jacobian = np.vstack([
        pin.getFrameJacobian(built.model, data, frame, world)[:3] for frame in built.contact_frames
    ])  # fmt: skip
    forces = np.linalg.lstsq(jacobian[:, :6].T, weight[:6], rcond=None)[0]
    torque = np.tile((weight - jacobian.T @ forces)[6:], (TICKS, 1))
    force = np.tile([0.0, 0.0, 9.81], (TICKS, 1))
    closed = np.ones((TICKS, len(ROBOT.contacts)), dtype=np.bool_)
    torque[FLIGHT], force[FLIGHT], closed[FLIGHT] = 0.0, 0.0, False
    phase = np.full(TICKS, STANDS)
    phase[FLIGHT] = FLIES
    still = np.zeros_like(torque)
    position = np.tile(ROBOT.standing_position, (TICKS, 1))
    three = np.zeros((TICKS, 3))
    return MeasuredRun(PERIOD, position, still, torque, three, force, three, closed), phase


def left(motion: MeasuredRun, phase: np.ndarray, found: Calibration) -> dict[str, dict[str, float]]:
    return phase_residuals(ROBOT, motion, phase, NAMES, frozenset({STANDS}), found)


@pytest.fixture(scope="module")
def measured() -> tuple[MeasuredRun, np.ndarray]:
    return run()


def test_a_right_model_explains_standing_and_flight(
    measured: tuple[MeasuredRun, np.ndarray],
) -> None:
    motion, phase = measured
    found = left(motion, phase, exact())
    assert list(found) == ["stand", "flight"]  # it never recovers
    for phases in found.values():
        assert set(phases) == JUDGED
        assert phases.pop("force") < 0.5  # of 50 N: the filter mixes both a little
        assert max(phases.values()) < 0.03


def test_a_switch_that_opens_in_stance_changes_nothing(
    measured: tuple[MeasuredRun, np.ndarray],
) -> None:
    motion, phase = measured
    opened = motion.closed.copy()
    opened[200:300, 0] = False
    assert left(replace(motion, closed=opened), phase, exact()) == left(motion, phase, exact())


def test_a_wrong_torque_is_seen_at_its_joint_in_flight_alone(
    measured: tuple[MeasuredRun, np.ndarray],
) -> None:
    motion, phase = measured
    pulled = motion.torque.copy()
    pulled[FLIGHT, 3] = 0.5
    found = left(replace(motion, torque=pulled), phase, exact())
    knee = ROBOT.joints[3].name
    assert found["flight"][knee] == pytest.approx(0.5, rel=0.05)
    assert (
        max(value for name, value in found["flight"].items() if name not in (knee, "force")) < 0.03
    )
    assert max(found["stand"].values()) < 0.05


def test_a_wrong_mass_is_seen_in_stance_alone(measured: tuple[MeasuredRun, np.ndarray]) -> None:
    motion, phase = measured
    heavy = exact().model_copy(update={"mass": Value(value=1.1 * ROBOT.total_mass, std=0.0)})
    found = left(motion, phase, heavy)
    assert max(found["stand"].values()) > 0.05
    assert found["flight"] == pytest.approx(left(motion, phase, exact())["flight"], abs=0.05)
