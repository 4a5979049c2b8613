"""Physics steps of a robot in the air: Runge and Kutta's method conserves momentum, MuJoCo's method of one stage does not."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from aloft.hal.simulated.mujoco_model import build_mujoco_model
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.hal.simulated.physics_step import flight_step_calls, step_calls
from aloft.hal.simulated.variation import Variation
from aloft.robots.description import find_robot
from aloft.robots.kinematics import standing_heights
from aloft.runtime.testing.bench import BlockBench

BRUCE = find_robot("bruce")
STEP = 0.0005


def swinging(integrator: str) -> tuple[Any, float]:
    """BRUCE without gravity after 0.4 s in which it swings its legs, and the largest speed of its CoM [m/s]."""
    model = build_mujoco_model(BRUCE, timestep=STEP, variation=Variation(gravity=(0, 0, 0)))
    data = mujoco.MjData(model)
    data.qpos[2], data.qpos[7:] = 2.0, BRUCE.standing_position
    start, signs = data.qpos[7:].copy(), np.sign(np.arange(10) % 2 - 0.5)
    first, second = step_calls(model, data)
    calls: list[Any] = flight_step_calls(model, data, second) if integrator == "RK4" else [second]
    first.run()
    fastest = 0.0
    for k in range(round(0.4 / STEP)):
        phase = 5.0 * np.pi * k * STEP
        away = start + 0.5 * np.sin(phase) * signs - data.qpos[7:]
        speed = 2.5 * np.pi * np.cos(phase) * signs - data.qvel[6:]
        data.qfrc_applied[6:] = np.clip(60.0 * away + speed, -20.0, 20.0)
        for call in (*calls, first):
            call.take_turn()
        mujoco.mj_subtreeVel(model, data)
        fastest = max(fastest, float(np.linalg.norm(data.subtree_linvel[1])))
    return data, fastest


def test_flight_conserves_momentum_with_four_stages() -> None:
    assert swinging("implicitfast")[1] > 5e-3
    data, fastest = swinging("RK4")
    assert fastest < 1e-6 and data.time == pytest.approx(0.4)


def test_the_accelerometer_is_that_of_the_steps_beginning() -> None:
    model = build_mujoco_model(BRUCE, timestep=STEP)
    data, fresh = mujoco.MjData(model), mujoco.MjData(model)
    data.qpos[2], data.qpos[7:], data.qvel[6:] = 2.0, BRUCE.standing_position, 1.0
    first, second = step_calls(model, data)
    calls = flight_step_calls(model, data, second)
    first.run()
    for _ in range(5):
        fresh.qpos[:], fresh.qvel[:] = data.qpos, data.qvel
        mujoco.mj_forward(model, fresh)
        for call in calls:
            call.take_turn()
        np.testing.assert_allclose(
            data.sensor("accelerometer").data, fresh.sensor("accelerometer").data, atol=1e-9
        )
        first.run()


def test_steps_with_contacts_are_those_without_it() -> None:
    ends = []
    for integrator in ("implicitfast", "RK4"):
        model = build_mujoco_model(BRUCE, timestep=STEP)
        data = mujoco.MjData(model)
        data.qpos[7:] = BRUCE.standing_position
        data.qpos[2] = -float(np.min(standing_heights(BRUCE))) - 1e-3
        first, second = step_calls(model, data)
        calls: list[Any] = (
            [second] if integrator == "implicitfast" else flight_step_calls(model, data, second)
        )
        first.run()
        for _ in range(10):
            assert data.ncon
            for call in (*calls, first):
                call.take_turn()
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(ends[0], ends[1])


def test_a_touchdown_within_a_step_acts_from_the_next_one_on() -> None:
    """Else its blow would change the velocity unseen by the accelerometer, which shows the step's beginning."""
    model = build_mujoco_model(BRUCE, timestep=STEP)
    data = mujoco.MjData(model)
    data.qpos[7:], data.qvel[2] = BRUCE.standing_position, -1.5
    data.qpos[2] = 1e-4 - float(np.min(standing_heights(BRUCE)))
    first, second = step_calls(model, data)
    first.run()
    assert not data.ncon
    for call in (*flight_step_calls(model, data, second), first):
        call.take_turn()
    assert data.ncon, "the feet are in the ground by 0.65 mm"
    assert data.qvel[2] == pytest.approx(-1.5 - 9.81 * STEP, abs=1e-4)


def test_the_flight_has_the_friction_of_the_present() -> None:
    """Effects of a trial change it while it runs."""
    ends = []
    for changed in (False, True):
        model = build_mujoco_model(BRUCE, timestep=STEP)
        data = mujoco.MjData(model)
        data.qpos[2], data.qpos[7:], data.qfrc_applied[6:] = 2.0, BRUCE.standing_position, 5.0
        first, second = step_calls(model, data)
        if not changed:
            model.dof_frictionloss[6:] = 3.0
        calls = flight_step_calls(model, data, second)
        model.dof_frictionloss[6:] = 3.0
        for call in (first, *calls):
            call.take_turn()
        ends.append(data.qvel.copy())
    np.testing.assert_array_equal(ends[0], ends[1])


def test_a_robot_falls_with_either() -> None:
    heights = []
    for integrator in ("implicitfast", "RK4"):
        robot = BlockBench(MujocoRobot, {"flight_integrator": integrator}, robot=BRUCE)
        for _ in range(50):
            robot.step()
        robot.block.emit()
        heights.append(float(robot.get("truth").com[2]))
    assert heights[1] == pytest.approx(heights[0], abs=1e-4)
