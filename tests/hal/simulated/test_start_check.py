"""A simulated robot starts only if it stands as its description says, and says why it does not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.hal.simulated.stance import StartError
from aloft.robots.description import RobotDescription, find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing.bench import BlockBench

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
        "of mass is 36 mm outside its contact points, so it tips over"
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
        "shoulder_motor has 2 N m and would need 2.76 N m"
    )


def test_a_floating_body_without_feet_or_shapes_has_nothing_to_rest_on(arm: Data) -> None:
    arm["base_joint"] = "floating"
    for link in arm["links"]:
        link["shapes"] = []
    with pytest.raises(StartError, match="has neither feet nor shapes to rest on"):
        start(arm)


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
