"""The plant: the same physics whoever drives it, and exact snapshots."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aloft.hal.random_streams import Purpose
from aloft.hal.simulated import physics_step
from aloft.hal.simulated.drives import MotorLimits
from aloft.hal.simulated.external_forces import PushPoints, apply_push, clear_wrenches
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.hal.simulated.plant import Plant
from aloft.hal.simulated.state import PhysicsState, TickRecord
from aloft.mathematics.arrays import Array, Indices
from aloft.mathematics.compiling.foreign_call import ForeignCall
from aloft.robots.description import RobotDescription, find_robot
from aloft.runtime.testing.bench import BlockBench

from ...simulator_settings import grouped
from .simulated_bruce import hold

ROBOT = find_robot("bruce")
PERIOD = 0.002


class HoldingDrives:
    """Drives that hold a pose with the plant's own gains, written without any of hal's drives."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.limits = MotorLimits(ROBOT, plant.record)
        self.steps: list[int] = []

    def hold(self, position: Array, torque: Array) -> None:
        self.position, self.torque = position.copy(), torque.copy()

    def torque_call(
        self, step: Indices, position: Array, velocity: Array, speed: Array, out: Array
    ) -> ForeignCall:
        def write() -> None:
            self.steps.append(int(step))
            out[:] = self.torque + self.plant.stiffness * (self.position - position)
            out[:] -= self.plant.damping * velocity

        return ForeignCall(write, 0)


def plant_of(robot: RobotDescription, **params: object) -> Plant:
    chosen = SimulatorParameters.model_validate(grouped(params))
    sizes = {**robot.dimensions, **Plant.state_dimensions(chosen, robot)}
    return Plant(robot, chosen, PERIOD, PhysicsState.allocate(sizes), TickRecord.allocate(sizes))


def test_stands_with_any_drives_and_counts_its_steps() -> None:
    plant = plant_of(ROBOT, timestep=0.001)
    drives = HoldingDrives(plant)
    step = plant.simulation(drives, 1)
    plant.stand(step, drives.hold)
    assert plant.physics.step == 0
    assert drives.steps[-2:] == [-2, -1]
    plant.clear_record()
    plant.simulation(drives, 50).run()
    assert plant.physics.step == 50 and plant.record.steps == 50
    assert float(-plant.record.load[:, 3].sum()) / 50 == pytest.approx(
        ROBOT.total_mass * 9.81, rel=0.01
    )
    assert np.abs(plant.position - ROBOT.standing_position).max() < 0.01


def test_loaded_it_goes_on_bit_for_bit() -> None:
    plant = plant_of(ROBOT, seed=3, timestep=0.001, gyro_noise=0.02, joint_velocity_noise=0.05)
    drives = HoldingDrives(plant)
    step = plant.simulation(drives, 1)
    plant.stand(step, drives.hold)
    plant.simulation(drives, 10).run()
    plant.save()
    kept = {name: view.copy() for name, view in plant.physics}
    plant.simulation(drives, 30).run()
    first = plant.data.qpos.copy(), plant.streams[Purpose.GYRO].random()
    for name, view in plant.physics:
        view[...] = kept[name]
    plant.load()
    plant.simulation(drives, 30).run()
    np.testing.assert_array_equal(plant.data.qpos, first[0])
    assert plant.streams[Purpose.GYRO].random() == first[1]


PUSHES = {3: [20.0, -5.0, 1.0], 9: [0.0, 40.0, 0.0]}


GEARS = {"gears": {"stiffness": 500.0, "damping": 0.5, "backlash": 0.001}}


def run(ticks: int = 20, **options: Any) -> tuple[BlockBench[MujocoRobot], list[bytes]]:
    """A robot with every disturbance that is pushed at two points; its ports in every tick."""
    params = grouped({**MujocoRobot.example_parameters(), "seed": 7, **GEARS})
    robot: BlockBench[MujocoRobot] = BlockBench(MujocoRobot, params, robot="bruce", **options)
    hold(robot)
    seen = []
    for tick in range(ticks):
        robot.set("push", force=PUSHES.get(tick, [0.0, 0.0, 0.0]), point=tick % 4)
        robot.step()
        seen.append(robot.memory.bus.buffer.tobytes())
    for _ in range(2):
        robot.block.stop_cycle()
    robot.block.emit()
    return robot, [*seen, robot.memory.bus.buffer.tobytes(), robot.snapshot().state]


@pytest.mark.long
def test_machine_code_and_python_simulate_the_same_bytes() -> None:
    quick, seen = run()
    slow, expected = run(plain=True)
    assert quick.block._ticking.native and quick.block._damped.native
    assert not slow.block._ticking.native
    assert seen == expected


def test_without_the_address_of_its_functions_python_calls_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(physics_step, "_address", lambda name: 0)
    robot, seen = run(5)
    assert not robot.block._ticking.native
    monkeypatch.undo()
    assert seen == run(5)[1]


def test_a_simulation_that_diverges_is_noticed() -> None:
    """What is not a number stays so, also where no interpreter looks at the simulator's warning."""
    robot, _ = run(2)
    data: Any = robot.block.plant.data
    data.qvel[3] = np.nan
    robot.step()
    robot.block.emit()
    assert np.isnan(robot.get("truth").base_angular_velocity).any()


def test_a_push_beside_the_centre_of_mass_turns_its_body_by_the_lever() -> None:
    random = np.random.default_rng(2)
    places, centres = random.normal(size=(4, 3)), random.normal(size=(3, 3))
    points = PushPoints(
        sites=np.array([3, 1]), bodies=np.array([2, 0]), places=places, centres=centres,
        wrenches=np.full((3, 6), 7.0), missing=np.zeros(1, dtype=np.bool_),
    )  # fmt: skip
    clear_wrenches(points.wrenches)
    assert not points.wrenches.any()
    apply_push(np.zeros(3), np.array(9), points)
    assert not points.wrenches.any() and not points.missing[0], "no force acts at no point"
    for number, (site, body) in enumerate(((3, 2), (1, 0))):
        force = random.normal(size=3)
        apply_push(force, np.array(number), points)
        np.testing.assert_allclose(points.wrenches[body, :3], force)
        lever = places[site] - centres[body]
        np.testing.assert_allclose(points.wrenches[body, 3:], np.cross(lever, force), atol=1e-12)
    assert not points.wrenches[1].any()
    for force in np.eye(3):
        for number in (-1, 2):
            points.missing[0] = False
            apply_push(force, np.array(number), points)
            assert points.missing[0]
