"""The simulator takes robots of other kinds than a biped: their physics is what it should be."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from aloft.blocks.signals import CommandMode
from aloft.hal.simulated.mujoco_model import build_mujoco_model
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.hal.simulated.stance import StartError
from aloft.hal.simulated.unsupported import unsupported_motor
from aloft.robots.description import RobotDescription, find_robot
from aloft.runtime.language.context import Clock, Context
from aloft.runtime.testing.bench import BlockBench

from ...simulator_settings import grouped

Data = dict[str, Any]


def described(data: Data) -> RobotDescription:
    return RobotDescription.model_validate(data)


def bench(data: Data, **params: Any) -> BlockBench[MujocoRobot]:
    return BlockBench(MujocoRobot, grouped(params), robot=described(data))


def truth(robot: BlockBench[MujocoRobot]) -> Any:
    robot.block.emit()
    return robot.get("truth")


def test_a_fixed_arm_starts_held_and_swings_as_a_pendulum_when_let_go(arm: Data) -> None:
    robot = bench(arm, scene="none")
    seen = truth(robot)
    assert seen.joint_position == pytest.approx([0.5, 0.7], abs=1e-3)
    assert not robot.get("imu").specific_force.any() and len(robot.get("contacts").closed) == 0
    energy, kept = [], robot.block.plant.data
    robot.block.plant.model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    robot.block.plant.model.dof_frictionloss[:] = 0.0
    robot.block.plant.model.dof_damping[:] = 0.0
    robot.set("command", mode=CommandMode.OFF)
    for _ in range(200):
        robot.step()
        mujoco.mj_energyPos(robot.block.plant.model, kept)
        mujoco.mj_energyVel(robot.block.plant.model, kept)
        energy.append(sum(kept.energy))
    assert abs(truth(robot).joint_position[0]) > 0.6
    assert max(energy) - min(energy) < 0.02 * (1.6 * 9.81 * 0.4)


def test_a_joint_without_a_motor_is_kept_until_the_run_begins_and_then_falls(
    cart_pole: Data,
) -> None:
    robot = bench(cart_pole)
    seen = truth(robot)
    assert seen.joint_position[1] == 0.1 and seen.joint_velocity[1] == 0.0
    robot.set("command", mode=CommandMode.ACTIVE, torque=[0.0, 5.0])
    robot.step(50)
    seen = truth(robot)
    # Free on its cart: w^2 = m g l / (I - (m l)^2 / M), and no motor to follow the command of 5 N m.
    inertia, lever = 0.004 + 0.2 * 0.25**2, 0.2 * 0.25
    rate = math.sqrt(lever * 9.81 / (inertia - lever**2 / 1.2))
    assert seen.joint_position[1] == pytest.approx(0.1 * math.cosh(rate * 0.1), rel=0.01)
    assert seen.motor_torque[1] == 0.0 and abs(seen.com_velocity[0]) < 1e-3


def test_the_force_on_a_slide_is_in_newtons(cart_pole: Data) -> None:
    cart_pole["standing"] = {}
    robot = bench(cart_pole)
    robot.set("command", mode=CommandMode.ACTIVE, torque=[6.0, 0.0])
    robot.step(50)
    assert truth(robot).com_velocity[0] * 2.2 == pytest.approx(6.0 * 0.1, rel=0.01)


def test_a_planar_robot_stands_pitches_and_tells_its_base_in_three_dimensions(
    quadruped: Data,
) -> None:
    quadruped["base_joint"] = "planar"
    robot = bench(quadruped, initial_attitude_error=0.05, seed=1)
    seen = truth(robot)
    assert seen.contact_force[:, 2].sum() == pytest.approx(12.0 * 9.81, rel=1e-3)
    assert seen.base_position[2] == pytest.approx(0.2986, abs=0.002)
    assert abs(seen.base_orientation[1]) > 1e-3
    assert seen.base_orientation[0] == seen.base_orientation[2] == seen.base_position[1] == 0.0
    robot.set("push", force=[0.0, 500.0, 0.0])
    robot.step(5)
    assert abs(truth(robot).com_velocity[1]) < 1e-15


def test_a_body_without_feet_lies_on_its_lowest_shape(arm: Data) -> None:
    arm["base_joint"], arm["standing"] = "floating", {"shoulder": math.pi / 2}
    arm["links"][0]["shapes"] = [
        {"start": [0, y, 0.0], "end": [0.7, y, 0.0], "radius": 0.1} for y in (-0.2, 0.2)
    ]
    robot = bench(arm)
    assert truth(robot).base_position[2] == pytest.approx(0.1, abs=1e-3)


def test_rotors_geared_to_three_joints_are_exact(quadruped: Data) -> None:
    generator = np.random.default_rng(3)
    matrix = np.eye(12)
    matrix[:3, :3] = generator.normal(size=(3, 3)) + 2.0 * np.eye(3)
    quadruped["transmission"]["joint_to_motor"] = matrix.tolist()
    quadruped["profiles"]["motor"]["motors"] = {"front_left_hip*": {"rotor_inertia": 0.02}}
    robot = described(quadruped)
    model = build_mujoco_model(robot)
    quadruped["profiles"]["motor"]["motors"] = {"*": {"rotor_inertia": 0.0}}
    without = build_mujoco_model(described(quadruped))
    added = mass_matrix(model) - mass_matrix(without)
    np.testing.assert_allclose(added[6:, 6:], robot.rotor_matrix, atol=1e-12)
    assert abs(robot.rotor_matrix[0, 1]) > robot.rotor_matrix[1, 1] / 10


def mass_matrix(model: Any) -> Any:
    data, full = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, full)
    return full


def test_a_rotor_geared_to_two_limbs_is_reported_at_load(quadruped: Data) -> None:
    matrix = np.eye(12)
    matrix[0, 3] = 1.0
    quadruped["transmission"]["joint_to_motor"] = matrix.tolist()
    robot = described(quadruped)
    assert unsupported_motor(robot).startswith(
        "motor front_left_hip_joint_motor is geared to front_left_hip_joint and "
        "front_right_hip_joint, and neither joint carries the other"
    )
    (unmet,) = MujocoRobot.requires(
        MujocoRobot.Params(), Context("block", Clock(0.002), robot=robot)
    )
    assert unmet.message == unsupported_motor(robot)


def test_two_equal_motors_on_two_joints_need_no_tendon(quadruped: Data) -> None:
    matrix = np.eye(12)
    matrix[:2, :2] = [[1.0, -1.0], [1.0, 1.0]]
    quadruped["transmission"]["joint_to_motor"] = matrix.tolist()
    assert build_mujoco_model(described(quadruped)).ntendon == 0


def test_limbs_that_overlap_in_the_standing_pose_do_not_collide(quadruped: Data) -> None:
    for k in (2, 5):  # the front thighs reach to the middle
        quadruped["links"][k]["shapes"] = [
            {"start": [0, -0.2, -0.1], "end": [0, 0.2, -0.1], "radius": 0.02}
        ]
    model = build_mujoco_model(described(quadruped))
    assert model.nexclude == 1
    robot = bench(quadruped)
    assert truth(robot).forbidden_contacts == 0


@pytest.mark.parametrize("mass", [0.2, 8.0])
def test_holding_gains_grow_with_the_robot(quadruped: Data, mass: float) -> None:
    for link in quadruped["links"]:
        link["mass"] *= mass
        link["inertia"] = [mass * value for value in link["inertia"]]
    quadruped["profiles"]["motor"]["rotor_inertia"] *= mass
    quadruped["profiles"]["motor"]["peak_torque"] *= mass
    stiffness: Any = bench(quadruped).block.plant.stiffness
    assert stiffness == pytest.approx(18.0 * 9.81 * 12.0 * mass * 0.272, rel=0.06)


def test_runs_of_other_robots_can_be_restored_exactly(cart_pole: Data) -> None:
    robot = bench(cart_pole, encoder_offset=0.003, joint_velocity_noise=0.1, latency=0.002)
    robot.set("command", mode=CommandMode.ACTIVE, torque=[3.0, 0.0])
    robot.step(5)
    kept = robot.snapshot()
    robot.step(20)
    expected = robot.snapshot()
    robot.restore(kept)
    robot.step(20)
    assert robot.snapshot() == expected


HOPPER = """<mujoco model="hopper"><worldbody><body name="torso" pos="0 0 1">
  <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>{pitch}
  <geom type="sphere" size=".1" mass="5"/><body name="leg"><joint name="hip" axis="0 1 0" range="-60 60"/>
  <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".03" mass="1"/></body></body></worldbody>
  <actuator><motor joint="hip" ctrlrange="-20 20"/></actuator>
  <keyframe><key name="home" qpos="0 0 0 0.5"/></keyframe></mujoco>"""


def test_a_robot_without_feet_begins_from_rest_in_its_pose_and_falls(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(HOPPER.format(pitch='<joint name="pitch" axis="0 1 0"/>'))
    hopper = find_robot("robot.xml", tmp_path)
    assert hopper.base_joint == "planar" and not hopper.feet
    robot = BlockBench(MujocoRobot, {}, robot=hopper)
    start = truth(robot)
    place, speed = start.base_position.copy(), start.base_linear_velocity.copy()
    assert start.joint_position == pytest.approx([0.5], abs=1e-3)
    assert np.abs(speed).max() < 0.03, "a period of physics after rest"
    robot.set("command", mode=CommandMode.DAMPING)
    for _ in range(500):
        robot.step()
    fallen = truth(robot).base_position
    assert fallen[2] < place[2] - 0.05 and np.isfinite(fallen).all()


def test_a_robot_with_feet_need_not_stand() -> None:
    bruce = find_robot("bruce")
    turned = {f"{side}_{joint}": angle for side in ("left", "right")
              for joint, angle in (("hip_pitch", 0.1), ("ankle", 0.7))}  # fmt: skip
    leaning = bruce.changed(standing={**bruce.standing, **turned})
    with pytest.raises(StartError, match=r"with `start: \{stand: false\}` it begins in that pose"):
        BlockBench(MujocoRobot, {}, robot=leaning)
    robot = BlockBench(MujocoRobot, {"start": {"stand": False}}, robot=leaning)
    assert truth(robot).joint_position == pytest.approx(leaning.standing_position, abs=1e-3)
    uneven = bruce.changed(standing={**bruce.standing, "left_knee": -1.2})
    robot = BlockBench(MujocoRobot, {"start": {"stand": False}}, robot=uneven)
    assert truth(robot).joint_position == pytest.approx(uneven.standing_position, abs=5e-3)
