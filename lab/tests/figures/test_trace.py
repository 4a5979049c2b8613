"""What figures read from a run."""

import numpy as np
import pytest

from aloft.lab.figures.curves import jump_numbers, push_numbers
from aloft.lab.figures.trace import Trace, pitch_and_roll
from aloft.studies.journal import Outcome

PERIOD = 0.002
LIFT_OFF, TOUCHDOWN = 100, 200


def trace(*, hop: bool = True) -> Trace:
    """0.6 s: a bounce of 4 ms, then a flight of 0.2 s with a push along x in it."""
    ticks = 300
    k = np.arange(ticks)
    touched = np.ones((ticks, 4), bool)
    touched[40:42] = False
    if hop:
        touched[LIFT_OFF:TOUCHDOWN] = False
    com = np.zeros((ticks, 3))
    com[:, 2] = (
        0.3 - 0.1 * np.exp(-(((k - 80) / 10) ** 2)) + 0.12 * np.exp(-(((k - 150) / 25) ** 2))
    )
    velocity, momentum, force = (np.zeros((ticks, 3)) for _ in range(3))
    force[115:120, 0] = 70.0
    velocity[:, 0] = 0.137 * np.clip((k - 115) / 5, 0, 1)
    momentum[:, 1] = 0.02 + 0.09 * np.clip((k - 115) / 5, 0, 1)
    points = np.zeros((ticks, 4, 3))
    points[:, :, 0] = [0.05, -0.05, 0.05, -0.05]
    points[:, 2:, 0] += 0.03 * np.clip((k - 120) / 60, 0, 1)[:, None]
    quaternion = np.zeros((ticks, 4))
    pitch = np.radians(30.0 - 20.0 * np.clip((k - LIFT_OFF) / 99, 0, 1))
    quaternion[:, 1], quaternion[:, 3] = np.sin(pitch / 2), np.cos(pitch / 2)
    planned = np.zeros((ticks, 4))
    turn = np.radians(30.0 - 15.0 * np.clip((k - LIFT_OFF) / 99, 0, 1))
    planned[:, 1], planned[:, 3] = np.sin(turn / 2), np.cos(turn / 2)
    landing = np.zeros((ticks, 2, 3))
    landing[120:, :, 0] = 0.02
    signals = {
        "robot.truth.contact_touched": touched, "robot.truth.com": com,
        "robot.truth.com_velocity": velocity, "robot.truth.angular_momentum": momentum,
        "robot.truth.contact_position": points, "robot.truth.base_orientation": quaternion,
        "robot.truth.joint_velocity": np.full((ticks, 10), -4.0),
        "robot.joints.torque": np.full((ticks, 10), -7.0), "push.push.force": force,
        "landing.feet.landing": landing, "plan.reference.orientation": planned,
    }  # fmt: skip
    return Trace("jump", 0, Outcome(True, "all criteria hold"), k * PERIOD, signals)


def test_a_bounce_is_no_flight() -> None:
    assert trace().flight == slice(LIFT_OFF, TOUCHDOWN)
    assert trace().flight_times == pytest.approx((0.2, 0.4))
    assert trace(hop=False).flight is None and trace(hop=False).flight_times is None


def test_numbers_of_a_jump() -> None:
    numbers = jump_numbers(trace())
    assert numbers["com_squat_to_apex_cm"] == pytest.approx(22.0, abs=0.1)
    assert numbers["flight_s"] == pytest.approx(0.2)
    assert numbers["pitch_change_in_flight_deg"] == pytest.approx(-20.0)
    assert numbers["planned_pitch_change_in_flight_deg"] == pytest.approx(-15.0)
    assert numbers["k_y_at_most_in_thrust_nms"] == pytest.approx(0.02)
    assert numbers["peak_joint_torque_nm"] == 7.0 and numbers["peak_joint_velocity_rad_s"] == 4.0
    assert "flight_s" not in jump_numbers(trace(hop=False))


def test_numbers_of_a_push() -> None:
    numbers = push_numbers(trace(), 0)
    assert numbers["com_velocity_change_m_s"] == pytest.approx(0.137)
    assert numbers["angular_momentum_change_nms"] == pytest.approx(0.09)
    assert numbers["left_foot_wanted_cm"] == pytest.approx(2.0)
    assert numbers["left_foot_moved_cm"] == pytest.approx(3.0)
    assert numbers["right_foot_moved_cm"] == pytest.approx(0.0)
    assert push_numbers(trace(hop=False), 0) == {}


def test_pitch_and_roll() -> None:
    half = np.radians(15.0)
    about_y, about_x = (
        [0.0, np.sin(half), 0.0, np.cos(half)],
        [np.sin(half), 0.0, 0.0, np.cos(half)],
    )
    pitch, roll = pitch_and_roll(np.array([about_y, about_x]))
    assert np.degrees(pitch) == pytest.approx([30.0, 0.0])
    assert np.degrees(roll) == pytest.approx([0.0, 30.0])
