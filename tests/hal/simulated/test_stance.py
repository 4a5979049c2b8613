from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml

from aloft.hal.simulated.base import FloatingBase
from aloft.hal.simulated.mujoco_model import build_mujoco_model
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.hal.simulated.stance import (
    StartError,
    centre_on_origin,
    holding_torque,
    set_standing_pose,
)
from aloft.planner.models.robot_model import StanceFinder
from aloft.planner.task.sequence import Slope, StanceLocation, ground_axes
from aloft.robots.description import RobotDescription, find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing.bench import BlockBench

ROBOT = find_robot("bruce")
MODEL = build_mujoco_model(ROBOT)


def placed(attitude: Any) -> Any:
    data = mujoco.MjData(MODEL)
    set_standing_pose(MODEL, data, FloatingBase(data), ROBOT, np.array(attitude))
    mujoco.mj_forward(MODEL, data)
    return data


@pytest.mark.parametrize("attitude", [[0, 0, 0], [0.03, 0, 0], [0, -0.03, 0], [0.01, 0.02, -0.03]])
def test_soles_are_flat_on_the_ground_under_a_turned_torso(attitude: Any) -> None:
    data = placed(attitude)
    places = np.array([data.site(contact.name).xpos for contact in ROBOT.contacts])
    np.testing.assert_allclose(places[:, 2], 0.0, atol=1e-9)
    np.testing.assert_allclose(places[:, 0], [0.0425, -0.0425] * 2, atol=1e-9)
    half = np.linalg.norm(attitude) / 2
    assert np.linalg.norm(data.qpos[4:7]) == pytest.approx(np.sin(half))


@pytest.mark.parametrize("slope", [(0.15, 0.0), (-0.1, 0.2)])
def test_on_ground_that_leans_it_stands_as_the_planner_has_it(slope: Slope) -> None:
    data, axes = mujoco.MjData(MODEL), ground_axes(slope)
    x, y, z = axes[:, 2].tolist()
    set_standing_pose(MODEL, data, FloatingBase(data), ROBOT, np.zeros(3), normal=(x, y, z))
    place = StanceLocation(0.0, 0.0, 0.0, 0.0, 0.0, slope)
    planned = StanceFinder(ROBOT).on_ground(np.array(ROBOT.standing_position), place)
    np.testing.assert_allclose(data.qpos[:3], planned.coordinates[:3], atol=1e-8)
    np.testing.assert_allclose(data.qpos[7:], planned.coordinates[6:], atol=1e-7)
    np.testing.assert_allclose(data.qpos[3:7], [1.0, 0.0, 0.0, 0.0], atol=1e-12)


def test_holding_torque_leaves_no_acceleration() -> None:
    data = placed([0.0, 0.01, 0.0])
    torque = holding_torque(MODEL, data, FloatingBase(data), ROBOT)
    jacobian = np.zeros((3, MODEL.nv))
    rows = []
    for contact in ROBOT.contacts:
        mujoco.mj_jacSite(MODEL, data, jacobian, None, data.site(contact.name).id)
        rows.append(jacobian.copy())
    matrix = np.vstack(rows)
    left = data.qfrc_bias - np.concatenate([np.zeros(6), torque])
    force = np.linalg.lstsq(matrix.T, left, rcond=None)[0]
    np.testing.assert_allclose(matrix.T @ force, left, atol=1e-9)
    assert force.reshape(-1, 3)[:, 2].sum() == pytest.approx(5.118 * 9.81)


def test_centring() -> None:
    data = placed([0.0, 0.0, 0.0])
    data.qpos[:2] += [0.3, -0.2]
    mujoco.mj_kinematics(MODEL, data)
    centre_on_origin(data, FloatingBase(data), ROBOT)
    mujoco.mj_kinematics(MODEL, data)
    places = np.array([data.site(contact.name).xpos for contact in ROBOT.contacts])
    np.testing.assert_allclose(places[:, :2].mean(axis=0), 0.0, atol=1e-12)


def test_an_attitude_the_legs_cannot_take_up_is_an_error() -> None:
    with pytest.raises(StartError, match="bruce cannot stand with its torso rotated by"):
        placed([1.2, 0.0, 0.0])


Data = dict[str, Any]


def start(data: Data) -> BlockBench[MujocoRobot]:
    return BlockBench(MujocoRobot, robot=RobotDescription.model_validate(data))


def failure(data: Data) -> str:
    with pytest.raises(StartError) as caught:
        start(data)
    prefix = f"{data['name']} does not "
    assert str(caught.value).startswith(prefix)
    return str(caught.value).removeprefix(prefix)


@pytest.mark.parametrize("radius", [0.0005, 0.02, 0.08])
def test_a_quadruped_with_tilted_shanks_stands_on_rubber_of_any_radius(
    quadruped: Data, radius: float
) -> None:
    for contact in quadruped["contacts"]:
        contact["radius"] = radius
    robot = start(quadruped)
    robot.block.emit()
    truth = robot.get("truth")
    assert truth.contact_force[:, 2].sum() == pytest.approx(12.0 * 9.81, rel=1e-3)
    assert truth.contact_position[:, 2] == pytest.approx(0.0, abs=2e-4)
    assert truth.forbidden_contacts == 0


@pytest.mark.parametrize("mass", [0.05, 20.0])
def test_contacts_give_way_by_the_same_little_whatever_the_robot_weighs(
    quadruped: Data, mass: float
) -> None:
    for link in quadruped["links"]:
        link["mass"] *= mass
        link["inertia"] = [mass * value for value in link["inertia"]]
    motor = quadruped["profiles"]["motor"]
    for name in ("peak_torque", "rotor_inertia", "friction", "damping"):
        motor[name] *= mass
    robot = start(quadruped)
    robot.block.emit()
    assert robot.get("truth").contact_position[:, 2] == pytest.approx(0.0, abs=2e-4)


def test_a_pose_that_tips_over(quadruped: Data) -> None:
    quadruped["links"][0]["com"] = [0.35, 0.0, 0.0]
    assert failure(quadruped) == (
        "stand as its description says when it is held in its standing pose for 0.3 s: its centre "
        "of mass is 36 mm outside its contact points, so it tips over; with `start: {stand: false}` it begins in that pose and falls if it falls"
    )


def test_motors_that_are_too_weak_are_named(quadruped: Data) -> None:
    quadruped["profiles"]["motor"]["peak_torque"] = 3.0
    assert "motor front_left_shank_joint_motor has 3 N m and would need 3.78 N m" in failure(
        quadruped
    )


def test_a_link_that_reaches_below_the_feet_is_named(quadruped: Data) -> None:
    quadruped["links"][3]["shapes"][0]["end"] = [0.0, 0.0, -0.23]
    assert "link front_left_shank touches the ground" in failure(quadruped)


def test_feet_at_different_heights_are_reported_at_load(quadruped: Data) -> None:
    quadruped["standing"]["rear_left_shank_joint"] = -1.8
    with pytest.raises(BlockError) as caught:
        start(quadruped)
    assert str(caught.value).startswith(
        "MujocoRobot: quadruped cannot stand on level ground: in its standing pose these contact "
        "points are above the lowest one: rear_left_ball by 31 mm"
    )


def test_a_robot_that_stands_on_its_toes() -> None:
    data = find_robot("bruce").model_dump()
    for side in ("right", "left"):
        data["standing"][f"{side}_ankle"] -= 0.3
    with pytest.raises(BlockError, match="right_heel by 25 mm, left_heel by 25 mm"):
        start(data)


def test_an_arm_that_its_motors_cannot_hold(arm: Data) -> None:
    arm["profiles"]["motor"]["peak_torque"] = 2.0
    assert failure(arm) == (
        "stay as its description says when it is held in its standing pose for 0.3 s: motor "
        "shoulder_motor has 2 N m and would need 2.76 N m; with `start: {stand: false}` it begins in that pose and falls if it falls"
    )


def test_a_floating_body_without_feet_or_shapes_has_nothing_to_rest_on(arm: Data) -> None:
    arm["base_joint"] = "floating"
    for link in arm["links"]:
        link["shapes"] = []
    with pytest.raises(StartError, match="has neither feet nor shapes to rest on"):
        start(arm)


def test_a_floating_body_without_feet_rests_on_the_lowest_corner_of_its_hull(arm: Data) -> None:
    arm["base_joint"] = "floating"
    for link in arm["links"]:
        link["shapes"] = []
    wedge = ((-0.2, 0.0), (0.2, 0.0), (0.05, 0.3))
    corners = [[x, y, z - 0.13] for x, z in wedge for y in (-0.2, 0.2)]
    arm["links"][0]["shapes"] = [{"corners": corners}]
    robot = start(arm)
    robot.block.emit()
    assert float(robot.get("truth").base_position[2]) == pytest.approx(0.13, abs=2e-3)


def test_a_run_that_cannot_start_says_why_and_fails(quadruped: Data, tmp_path: Path) -> None:
    quadruped["links"][0]["com"] = [0.35, 0.0, 0.0]
    (tmp_path / "quadruped.yaml").write_text(yaml.safe_dump(quadruped))
    (tmp_path / "graph.yaml").write_text(
        "rate: 500 Hz\nduration: 1 s\nrobot: quadruped.yaml\nblocks:\n"
        "  robot: {use: hal.MujocoRobot, in: {command: {value: {mode: 2}}}}\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "aloft", "run", "graph.yaml", "--no-record"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 3
    assert "block 'robot' failed in start: quadruped does not stand" in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr
