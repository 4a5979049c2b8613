"""An IMU on a link that moves reads at the base what the base does."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.hal.log.link_motion import imu_at_base, link_motion
from aloft.hal.log.log_file import LogArray, LogFile
from aloft.hal.log.parameters import LogParameters
from aloft.hal.log.played_log import play
from aloft.robots.description import find_robot
from aloft.robots.kinematics import link_poses

ROBOT = find_robot("bruce")
LINK, PLACE = "left_calf", np.array([0.02, -0.01, -0.1])
TIME = np.arange(0.0, 2.0, 0.002)
GRAVITY = np.array([0.0, 0.0, 9.81])


def slope(values):
    return np.gradient(values, TIME, axis=0)


def reading(position, rotation):
    """What an IMU reads that moves so in the world: rates and specific forces in its own axes."""
    back = np.swapaxes(rotation, 1, 2)
    spin = back @ slope(rotation.reshape(-1, 9)).reshape(-1, 3, 3)
    rates = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    return rates, np.einsum("nij,nj->ni", back, slope(slope(position)) + GRAVITY)


@pytest.fixture(scope="module")
def moving():
    """A base that moves and turns about z, and joints that swing."""
    n = len(ROBOT.joints)
    swing = np.outer(np.sin(2 * np.pi * 0.8 * TIME), np.linspace(0.1, 0.5, n))
    joints = ROBOT.standing_position + swing
    yaw = 0.4 * np.sin(2 * np.pi * 0.5 * TIME)
    four = np.stack([0 * yaw, 0 * yaw, np.sin(yaw / 2), np.cos(yaw / 2)], axis=1)
    base = 0.1 * np.stack([np.sin(3 * TIME), np.cos(2 * TIME), np.sin(4 * TIME)], axis=1)
    poses = link_poses(ROBOT, base, four, joints)
    origin, rotation = poses.of(LINK)
    return (
        joints, slope(joints), reading(origin + rotation @ PLACE, rotation),
        reading(*poses.of(ROBOT.base)),
    )  # fmt: skip


def test_the_base_moves_as_it_does(moving):
    joints, speeds, (rates, forces), (base_rates, base_forces) = moving
    motion = link_motion(ROBOT, LINK, PLACE, joints, speeds)
    found_rates, found_forces = imu_at_base(motion, TIME, rates, forces)
    inner = slice(10, -10)
    assert np.abs(forces - base_forces)[inner].max() > 3.0
    assert found_rates[inner] == pytest.approx(base_rates[inner], abs=1e-3)
    assert found_forces[inner] == pytest.approx(base_forces[inner], abs=0.02)


def test_a_log_names_the_link_that_carries_the_imu(moving, tmp_path):
    joints, speeds, (rates, forces), (_, base_forces) = moving
    arrays = {"t": TIME[:, None], "w": rates, "f": forces, "q": joints, "v": speeds}
    log = LogFile(tmp_path / "log", {name: LogArray(each) for name, each in arrays.items()})
    imu = {"angular_velocity": "w", "specific_force": "f", "link": LINK, "position": PLACE.tolist()}
    given = {
        "file": "log", "clock": {"stamps": "t"}, "imu": imu, "joints": {"position": "q", "velocity": "v"},
    }  # fmt: skip
    played = play(log, LogParameters.model_validate(given), ROBOT, 0.002)
    assert not played.problems and played.rows is not None
    assert played.rows.imu[10:-10, 3:] == pytest.approx(base_forces[10:-10], abs=0.02)
    wrong = LogParameters.model_validate(given | {"imu": imu | {"link": "left_claf"}})
    (problem,) = play(log, wrong, ROBOT, 0.002).problems
    assert (problem.message, problem.fix) == ("bruce has no link left_claf", "left_calf")
