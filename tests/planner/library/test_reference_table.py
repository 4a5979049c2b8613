"""The reference's table of a plan: its derivatives agree, it begins and ends at rest."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from aloft.mathematics.rotations import matrices_of_quaternions
from aloft.planner.library.jump_table import JumpTable
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.library.reference_table import pinocchio_quaternions, reference_table
from aloft.planner.task.plan import PlannedJump
from aloft.planner.task.read_task import read_task
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
STAND = 0.3


@pytest.fixture(scope="module", params=["forward_10cm", "twist_30deg", "in_situ"])
def plan(request: pytest.FixtureRequest) -> PlannedJump:
    task = read_task(SHIPPED.parent / "tasks" / f"{request.param}.yaml")
    found = PlanLibrary(ROBOT, Path("nowhere")).find(task)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def table(plan: PlannedJump) -> JumpTable:
    return reference_table(plan, ROBOT, STAND)


@pytest.mark.parametrize(
    ("place", "rate", "tolerance"),
    [
        ("com", "com_velocity", 0.01),
        ("joint_position", "joint_velocity", 0.05),
        ("foot_position", "foot_velocity", 0.02),
    ],
)
def test_rates_are_those_of_the_places(
    table: JumpTable, place: str, rate: str, tolerance: float
) -> None:
    steps = np.diff(table.time)
    lasting = steps > 1e-6
    change = np.diff(table.columns[place], axis=0)[lasting]
    change /= steps[lasting].reshape((-1,) + (1,) * (change.ndim - 1))
    mean = 0.5 * (table.columns[rate][1:] + table.columns[rate][:-1])[lasting]
    assert np.quantile(np.abs(change - mean), 0.99) < tolerance


def test_accelerations_are_the_changes_of_the_joint_rates(table: JumpTable) -> None:
    """But where they jump, from one interval of the plan to the next."""
    steps = np.diff(table.time)
    lasting = steps > 1e-6
    change = np.diff(table.columns["joint_velocity"], axis=0)[lasting] / steps[lasting, None]
    bends = table.columns["joint_acceleration"]
    off = np.abs(change - 0.5 * (bends[1:] + bends[:-1])[lasting])
    assert np.abs(bends).max() > 100.0
    assert np.quantile(off, 0.75) < 0.5
    assert np.quantile(off, 0.9) < 20.0


def test_forces_change_the_momentum(table: JumpTable, plan: PlannedJump) -> None:
    for start, end in ((STAND, table.lift_off_time), (table.touchdown_time, table.time[-1])):
        rows = (table.time >= start - 1e-9) & (table.time <= end + 1e-9)
        rows &= np.append(np.diff(table.time) > 1e-9, True)  # after an impact, not before it
        time = table.time[rows]
        for rate, total in (("com_acceleration", "com_velocity"),
                            ("angular_acceleration", "angular_velocity"),
                            ("angular_momentum_rate", "angular_momentum")):  # fmt: skip
            values = table.columns[rate][rows]
            gained = np.trapezoid(values, time, axis=0)
            change = table.columns[total][rows][-1] - table.columns[total][rows][0]
            np.testing.assert_allclose(gained, change, rtol=0.015, atol=0.06)


def test_heels_are_down_on_the_ground_and_up_where_they_rise(
    table: JumpTable, plan: PlannedJump
) -> None:
    pitch = table.columns["foot_pitch"]
    standing = (table.time < table.thrust_time) | (table.time > table.touchdown_time + 1e-9)
    assert np.abs(pitch[standing]).max() < 0.01
    lift_off = pitch[np.abs(table.time - table.lift_off_time).argmin()]
    rises = plan.task.phases is not None
    assert (lift_off > 0.1).all() if rises else (np.abs(lift_off) < 0.01).all()


def test_the_knots_are_in_it(table: JumpTable, plan: PlannedJump) -> None:
    for knot in (0, len(plan.time) // 3, len(plan.time) - 1):
        row = int(np.abs(table.time - STAND - plan.time[knot]).argmin())
        np.testing.assert_allclose(
            table.columns["joint_position"][row], plan.position[knot, 7:], atol=1e-9
        )
    assert np.diff(table.time).min() >= 0.0
    assert np.diff(table.time)[1:].max() <= 0.002 + 1e-9


def test_it_begins_and_ends_at_rest(table: JumpTable, plan: PlannedJump) -> None:
    for row in (0, 1, -1):
        for name in (
            "com_velocity",
            "com_acceleration",
            "angular_momentum_rate",
            "angular_velocity",
        ):
            np.testing.assert_allclose(table.columns[name][row], 0.0, atol=1e-2)
    assert table.squat_time == STAND
    assert STAND < table.thrust_time < table.lift_off_time < table.touchdown_time
    assert table.touchdown_time < table.recover_time <= table.time[-1]
    assert table.lift_off_time == pytest.approx(STAND + plan.lift_off_time)


def test_the_flight_keeps_its_momentum(table: JumpTable) -> None:
    flying = (table.time > table.lift_off_time) & (table.time < table.touchdown_time)
    assert np.ptp(table.columns["angular_momentum"][flying], axis=0).max() < 0.02
    np.testing.assert_allclose(
        table.columns["com_acceleration"][flying], [[0, 0, -9.81]] * flying.sum()
    )


def test_torques_are_the_plans_in_the_middle_of_every_interval(
    table: JumpTable, plan: PlannedJump
) -> None:
    steps = np.diff(plan.time)
    middles = STAND + plan.time[:-1] + 0.5 * steps
    found = np.array(
        [np.interp(middles, table.time, table.columns["joint_torque"][:, j]) for j in range(10)]
    ).T
    # Rows are up to 2 ms apart, and torques bend at the middles.
    inner = steps > 0.004
    np.testing.assert_allclose(found[inner], plan.joint_torque[:-1][inner], atol=0.4)


def test_quaternions_of_many_turns_have_the_bits_of_pinocchio() -> None:
    quaternions = np.random.default_rng(0).normal(size=(300, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    turns = np.array([pinocchio.Quaternion(row).toRotationMatrix() for row in quaternions])
    traces = np.trace(turns, axis1=1, axis2=2)
    assert traces.min() < 0.0 < traces.max(), "both ways are tried"
    np.testing.assert_array_equal(turns, matrices_of_quaternions(quaternions))
    expected = np.array([pinocchio.Quaternion(turn).coeffs() for turn in turns])
    np.testing.assert_array_equal(pinocchio_quaternions(pinocchio, turns), expected)
