"""The simulated robot obeys physics, its sensors have the stated statistics, its time is exact."""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tracemalloc
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from aloft.blocks.signals import CommandMode
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing.bench import BlockBench

from .simulated_bruce import bench, hold, lift

ROBOT = find_robot("bruce")
WEIGHT = 5.118 * 9.81
STANDARD: dict[str, Any] = {
    "gyro_noise": 0.02, "gyro_bias": 0.01, "accelerometer_noise": 0.1, "accelerometer_bias": 0.1,
    "encoder_offset": 0.003, "joint_velocity_noise": 0.05, "switch_threshold": [0.5, 3.0],
    "switch_bounce": 0.002, "initial_attitude_error": 0.01, "latency": 0.002, "jitter": 0.0005,
    "random_start_phase": True,
}  # fmt: skip


def truth(robot: BlockBench[MujocoRobot]) -> Any:
    robot.block.emit()
    return robot.get("truth")


def test_stands_still_with_its_weight_on_four_points() -> None:
    robot = bench()
    hold(robot)
    robot.step(250)
    seen = truth(robot)
    assert seen.contact_force[:, 2].sum() == pytest.approx(WEIGHT, rel=1e-4)
    assert (seen.contact_force[:, 2] > 0.2 * WEIGHT).all()
    assert seen.contact_touched.all() and robot.get("contacts").closed.all()
    assert np.linalg.norm(seen.com_velocity) < 1e-3
    assert seen.forbidden_contacts == 0 and seen.joint_limit_violation == 0.0
    np.testing.assert_allclose(seen.joint_position, ROBOT.standing_position, atol=2e-3)
    np.testing.assert_allclose(seen.contact_position[:, 2], 0.0, atol=2e-4)
    np.testing.assert_allclose(robot.get("imu").specific_force, [0, 0, 9.81], atol=0.02)


def test_starts_centred_between_its_soles() -> None:
    seen = truth(bench(initial_attitude_error=0.01, seed=4))
    np.testing.assert_allclose(seen.contact_position[:, :2].mean(axis=0), 0.0, atol=1e-6)
    assert 0.002 < np.linalg.norm(seen.base_orientation[:3]) < 0.05
    np.testing.assert_allclose(seen.contact_position[:, 2], 0.0, atol=2e-4)


def test_free_fall() -> None:
    robot = bench()
    lift(robot)
    before = truth(robot).com.copy()
    robot.step(100)
    seen = truth(robot)
    # Semi-implicit integration: the fall after n steps of h is g h^2 n (n + 1) / 2.
    steps, h = 400, 0.0005
    assert before[2] - seen.com[2] == pytest.approx(9.81 * h**2 * steps * (steps + 1) / 2, abs=1e-6)
    assert seen.com_velocity[2] == pytest.approx(-9.81 * 0.2, abs=1e-6)
    np.testing.assert_allclose(robot.get("imu").specific_force, 0.0, atol=1e-6)
    np.testing.assert_array_equal(seen.contact_force, 0.0)
    assert not seen.contact_touched.any()


def test_momentum_is_conserved_in_flight_whatever_the_legs_do() -> None:
    robot = bench(timestep=0.00025)
    lift(robot)
    robot.set("command", mode=CommandMode.ACTIVE, stiffness=40.0, damping=1.0, velocity=0.0,
              torque=0.0, position=ROBOT.standing_position + 0.2)  # fmt: skip
    robot.step()
    start = truth(robot)
    horizontal, angular = start.com_velocity[:2].copy(), start.angular_momentum.copy()
    robot.step(100)
    seen = truth(robot)
    assert np.abs(seen.joint_position - ROBOT.standing_position).max() > 0.1
    # What is left is the integrator's error; it halves with the step.
    np.testing.assert_allclose(seen.com_velocity[:2], horizontal, atol=2e-4)
    np.testing.assert_allclose(seen.angular_momentum, angular, atol=1e-3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_push_changes_momentum_by_its_impulse(axis: int) -> None:
    robot = bench()
    lift(robot)
    before = truth(robot)
    velocity, momentum = before.com_velocity.copy(), before.angular_momentum.copy()
    place, com = np.add(before.base_position, (0.02325, 0.0, 0.07844)), before.com.copy()
    force = np.zeros(3)
    force[axis] = 70.0
    robot.set("push", force=force, point=list(ROBOT.points).index("torso_com"))
    robot.step(5)
    robot.set("push", force=0.0)
    seen = truth(robot)
    change = 5.118 * (seen.com_velocity - velocity)
    change[2] += 5.118 * 9.81 * 0.01
    expected = np.zeros(3)
    expected[axis] = 0.7
    np.testing.assert_allclose(change, expected, atol=7e-4)  # 0.1 % of the impulse
    turn = np.cross(place - com, expected)
    np.testing.assert_allclose(seen.angular_momentum - momentum, turn, atol=3e-3)
    after = seen.com_velocity.copy()
    robot.step(5)
    np.testing.assert_allclose(truth(robot).com_velocity[:2], after[:2], atol=1e-5)


def test_a_push_at_no_point_is_an_error_that_names_those_there_are() -> None:
    robot = bench()
    robot.set("push", force=[1.0, 0.0, 0.0], point=99)
    with pytest.raises(IndexError, match=r"point 99; bruce has 8: torso_com, "):
        robot.step()


@pytest.mark.parametrize(
    ("latency", "ticks", "steps"), [(0.0, 0, 0), (0.002, 1, 0), (0.0035, 1, 3)]
)
def test_latency_is_exact_to_the_physics_step(latency: float, ticks: int, steps: int) -> None:
    robot = bench(latency=latency)
    hold(robot)
    robot.step(20)
    robot.block.emit()
    before = float(robot.get("joints").torque[3])
    seen = []
    torque = robot.get("command").torque.copy()
    torque[[3, 8]] += 1.0
    robot.set("command", torque=torque)
    # Follow the torque physics step by physics step.
    block: Any = robot.block
    one = block.plant.simulation(block._drives, 1, block.push)

    def simulate() -> None:
        for _ in range(4):
            one.run()
            seen.append(float(block.plant.data.ctrl[3]))

    block._ticking = SimpleNamespace(run=simulate)
    robot.step(ticks + 2)
    arrived = next(k for k, value in enumerate(seen) if value > before + 0.5)
    assert arrived == ticks * 4 + steps


def test_jitter_spreads_the_arrival_over_its_range() -> None:
    robot = bench(latency=0.002, jitter=0.002, timestep=0.00025)
    hold(robot)
    delays = []
    for _ in range(200):
        now = int(robot.block.physics.step)
        robot.step()
        delays.append(int(robot.block.drives.last_due) - now)
    assert min(delays) in (8, 9) and max(delays) == 16
    assert np.mean(delays) == pytest.approx(12.5, abs=0.6)


def test_motors_never_exceed_their_limits_and_report_saturation() -> None:
    robot = bench()
    lift(robot)
    robot.set("command", mode=CommandMode.ACTIVE, torque=100.0, position=0.0, velocity=0.0,
              stiffness=0.0, damping=0.0)  # fmt: skip
    robot.step(10)
    seen = truth(robot)
    assert np.abs(seen.motor_torque).max() <= 10.5 + 1e-12
    assert seen.motor_overload == 0.0
    assert seen.saturated_share > 0.3
    assert np.abs(seen.motor_speed).max() > 5.0


def test_modes() -> None:
    robot = bench()
    lift(robot)
    robot.set("command", mode=CommandMode.OFF, torque=5.0, stiffness=100.0, damping=1.0)
    robot.step(2)
    robot.block.emit()
    np.testing.assert_array_equal(robot.get("joints").torque, 0.0)
    lift(robot, 0.0)
    robot.block.plant.data.qvel[6:] = 2.0  # type: ignore[attr-defined]
    robot.set("command", mode=CommandMode.DAMPING, torque=5.0, stiffness=100.0, damping=99.0)
    robot.step()
    speeds = [np.abs(truth(robot).joint_velocity).max()]
    for _ in range(20):
        robot.step()
        speeds.append(np.abs(truth(robot).joint_velocity).max())
    assert speeds[-1] < 0.2 * speeds[0]
    torque, velocity = robot.get("joints").torque, robot.get("truth").joint_velocity
    assert (torque * velocity <= 1e-3).all()


def test_stop_cycles_damp_whatever_is_commanded() -> None:
    robot = bench()
    hold(robot)
    robot.step(5)
    robot.set("command", torque=100.0, mode=CommandMode.ACTIVE)
    before = int(robot.block.physics.step)
    for _ in range(5):
        robot.block.stop_cycle()
    assert int(robot.block.physics.step) == before + 20
    robot.block.emit()
    assert np.abs(robot.get("joints").torque).max() < 3.0


def test_touching_with_anything_else_is_counted() -> None:
    robot = bench()
    robot.set("command", mode=CommandMode.OFF)
    total = 0
    for _ in range(400):
        robot.step()
        total += int(robot.get("truth").forbidden_contacts)
    assert total > 100


def test_snapshot_and_restore_are_exact_through_a_fall() -> None:
    robot = bench(**STANDARD, seed=7)
    hold(robot)
    robot.step(10)
    robot.set("command", mode=CommandMode.OFF)
    robot.step(30)
    start = robot.snapshot()
    robot.step(150)
    expected = robot.snapshot()
    robot.step(13)
    robot.restore(start)
    robot.step(150)
    again = robot.snapshot()
    assert again.bus == expected.bus and again.state == expected.state


def digest(seed: int) -> str:
    robot = bench(**STANDARD, seed=seed)
    hold(robot)
    value = hashlib.sha256()
    for _ in range(100):
        robot.step()
        value.update(bytes(robot.memory.bus.buffer))
    return value.hexdigest()


@pytest.mark.long
def test_same_seed_same_bytes_in_every_process_on_every_cpu() -> None:
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[3])!r})\n"
        "from tests.hal.simulated.test_mujoco_robot import digest\nprint(digest(11))"
    )
    others = {
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True,
            env={"PYTHONHASHSEED": seed, "OPENBLAS_CORETYPE": cpu, "OMP_NUM_THREADS": "1"},
        ).stdout.strip()
        for seed, cpu in (("1", ""), ("2", "Nehalem"), ("3", "Sandybridge"))
    }  # fmt: skip
    assert others == {digest(11)}
    assert digest(12) != digest(11)


def test_robust_world_is_drawn_from_the_seed_within_its_ranges() -> None:
    drawn = []
    for seed in range(20):
        robot = bench(seed=seed, friction_range=[0.5, 1.0], mass_spread=0.05, base_com_spread=0.005,
                      contact_stiffness_spread=4.0)  # fmt: skip
        drawn.append(robot.block.plant.variation)
    assert all(0.5 <= v.friction <= 1.0 for v in drawn)
    assert all(0.95 <= v.mass <= 1.05 for v in drawn)
    assert all(0.25 <= v.contact_stiffness <= 4.0 for v in drawn)
    assert all(abs(x) <= 0.005 for v in drawn for x in v.base_com_offset)
    assert len({v.friction for v in drawn}) == 20
    assert min(v.contact_stiffness for v in drawn) < 0.5
    assert max(v.contact_stiffness for v in drawn) > 2.0


def test_platform_and_step_tell_the_ground_under_each_point() -> None:
    robot = bench(scene="platform", platform_height=0.35, platform_edge=0.08)
    robot.block.plant.data.qpos[0] += 0.06  # type: ignore[attr-defined]
    robot.block.save_state()
    robot.block.load_state()
    heights = truth(robot).ground_height
    np.testing.assert_array_equal(heights, [-0.35, 0.0, -0.35, 0.0])
    np.testing.assert_array_equal(truth(bench(scene="step")).ground_height, 0.0)


def test_ground_may_be_described_as_a_floor_and_boxes() -> None:
    scene = {"floor": "-50 cm", "boxes": [{"x": [-0.6, 0.08], "top": 0, "bottom": -0.5}]}
    described = bench(scene=scene).block.params.build_scene(None)  # type: ignore[attr-defined]
    assert described.height(0.0, 0.0) == 0.0
    assert described.floor == -0.5
    with pytest.raises(ValidationError, match=r"must have an extent along x: 0.1 to 0 m"):
        bench(scene={"boxes": [{"x": [0.1, 0.0], "top": 0.1}]})


def test_errors_say_what_is_there() -> None:
    with pytest.raises(BlockError, match=r"timestep 0.0003 s does not divide the control period"):
        bench(timestep=0.0003)
    with pytest.raises(BlockError, match="it needs a robot, and the graph names none"):
        BlockBench(MujocoRobot, {}, dimensions=ROBOT.dimensions)
    with pytest.raises(ValidationError, match="two positive numbers in rising order"):
        bench(friction_range=[1.0, 0.5])


def test_a_tick_allocates_no_array() -> None:
    robot = bench(**STANDARD)
    hold(robot)
    robot.set("push", force=[1.0, 2.0, 3.0])
    robot.step(10)
    tracemalloc.start()
    robot.step(1)
    before = tracemalloc.take_snapshot()
    robot.step(20)
    after = tracemalloc.take_snapshot()
    tracemalloc.stop()
    domain = np.lib.tracemalloc_domain
    arrays = [tracemalloc.DomainFilter(inclusive=True, domain=domain)]
    grown = after.filter_traces(arrays).compare_to(before.filter_traces(arrays), "lineno")
    assert sum(entry.size_diff for entry in grown) == 0


def test_stands_on_a_platform_and_slides_only_beyond_its_friction() -> None:
    robot = bench(scene="platform", platform_height=0.35, friction=0.3)
    hold(robot)
    robot.step(50)
    seen = truth(robot)
    assert seen.contact_force[:, 2].sum() == pytest.approx(WEIGHT, rel=1e-3)
    start = seen.contact_position.copy()
    for force, slides in ((0.7 * 0.3 * WEIGHT, False), (1.3 * 0.3 * WEIGHT, True)):
        robot.set("push", force=[0.0, force, 0.0], point=list(ROBOT.points).index("right_ankle"))
        robot.step(25)
        seen = truth(robot)
        along, normal = seen.contact_force[:, 1], seen.contact_force[:, 2]
        assert (np.abs(along) <= 0.3 * normal + 0.05).all()
        moved = np.abs(seen.contact_position - start)[:, 1].max()
        assert (moved > 0.002) == slides
