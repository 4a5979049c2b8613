"""Friction that is larger at rest than in motion, against its closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aloft.hal.simulated.effects import JointEffects, longest_stribeck_step
from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.hal.simulated.stribeck import friction_call
from aloft.hal.simulated.variation import draw_variation
from aloft.robots.description import find_robot

from .simulated_bruce import bench, hold

COULOMB, STATIC, SPEED = 0.2, 1.8, 0.3


def flywheel() -> tuple[object, object]:
    """A joint without gravity, of 0.01 kg m^2."""
    import mujoco

    spec = mujoco.MjSpec()
    spec.option.gravity = [0.0, 0.0, 0.0]
    spec.option.timestep = 1e-4
    body = spec.worldbody.add_body(
        name="wheel", mass=1.0, inertia=[0.01, 0.01, 0.01], explicitinertial=True
    )
    body.add_joint(name="axle", axis=[0, 0, 1], frictionloss=COULOMB)
    spec.add_actuator(name="motor", target="axle", trntype=mujoco.mjtTrn.mjTRN_JOINT).set_to_motor()
    model = spec.compile()
    return model, mujoco.MjData(model)


def turned(torque: float, seconds: float, speed: float = 0.0) -> float:
    """The speed [rad/s] of the wheel after so long under a torque [N m]."""
    import mujoco

    model, data = flywheel()
    data.qvel[0] = speed
    falling = friction_call(data.qvel, model.dof_frictionloss, (STATIC,), SPEED)
    for _ in range(round(seconds / model.opt.timestep)):
        falling.run()
        mujoco.mj_step1(model, data)
        data.ctrl[0] = torque
        mujoco.mj_step2(model, data)
    return float(data.qvel[0])


def test_below_its_static_friction_a_joint_stays_and_above_it_breaks_away() -> None:
    static = COULOMB * STATIC
    creeping = turned(0.97 * static, 0.25)  # the simulator's friction is not quite rigid
    assert abs(creeping) < 0.15 * SPEED
    assert turned(0.97 * static, 0.5) == pytest.approx(creeping, rel=0.01)
    assert turned(1.03 * static, 0.5) > 5.0


@pytest.mark.parametrize("speed", [0.1, 0.3, 0.6, 3.0])
def test_a_moving_joint_loses_what_the_closed_form_says(speed: float) -> None:
    """Held at its speed by a torque of F(v), it neither gains nor loses speed."""
    loss = COULOMB * (1.0 + (STATIC - 1.0) * math.exp(-((speed / SPEED) ** 2)))
    assert turned(loss, 0.01, speed) == pytest.approx(speed, rel=0.01)
    if speed > 2.0 * SPEED:  # below it the simulator's friction is not quite rigid
        lost = loss / 0.01 * 0.002
        assert speed - turned(0.0, 0.002, speed) == pytest.approx(lost, rel=0.05)


def test_friction_at_rest_is_drawn_for_each_joint_and_changes_no_other_draw() -> None:
    robot = find_robot("bruce")
    joints = {"static_friction": 1.5, "static_friction_spread": 0.4, "friction_spread": 0.2}
    first = draw_variation(
        SimulatorParameters.model_validate({"actuators": {"joints": joints}}), robot
    )
    static = np.array(first.static_friction)
    assert len(set(static.tolist())) == len(robot.joints)
    assert (abs((static - 1.0) / 0.5 - 1.0) <= 0.4).all()
    del joints["static_friction"]
    second = draw_variation(
        SimulatorParameters.model_validate({"actuators": {"joints": joints}}), robot
    )
    assert second.static_friction == () and second.friction_of_joint == first.friction_of_joint


def test_a_restored_robot_has_the_friction_of_its_speed() -> None:
    robot = bench(joints={"static_friction": 2.0})
    hold(robot)
    robot.step(20)
    model = robot.block.plant.model
    before = model.dof_frictionloss[6:].copy()
    assert (before > 0.07 * 1.5).all(), "a robot that stands is at rest"
    model.dof_frictionloss[6:] = 0.01
    robot.block.save_state()
    robot.block.load_state()
    np.testing.assert_array_equal(model.dof_frictionloss[6:], before)
    assert robot.block.metrics()["robot_largest_static_friction"] == 2.0


def test_the_longest_step_is_a_fifth_of_the_time_in_which_speed_grows() -> None:
    joints = JointEffects.model_validate({"static_friction": STATIC, "stribeck_velocity": SPEED})
    slope = COULOMB * (STATIC - 1.0) / SPEED * math.sqrt(2.0 / math.e)
    found = longest_stribeck_step(joints, np.array([COULOMB, 9.0]), np.array([2e-3, 0.0]))
    assert found == pytest.approx(0.2 * 2e-3 / slope)
    assert longest_stribeck_step(JointEffects(), np.ones(2), np.ones(2)) == math.inf
