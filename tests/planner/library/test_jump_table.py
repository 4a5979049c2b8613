"""The rotation of a somersault's flight with its joints held."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aloft.planner.library.jump_table import FlightRotation, JumpTable, flight_rotation
from aloft.planner.library.library import SHIPPED, PlanLibrary
from aloft.planner.library.reference_table import reference_table
from aloft.planner.task.read_task import read_task
from aloft.robots.description import RobotDescription, find_robot

STAND = 0.3


def table_of(name: str) -> tuple[JumpTable, RobotDescription]:
    task = read_task(SHIPPED.parent / "tasks" / f"{name}.yaml")
    robot = task.equipped(find_robot("bruce"))
    plan = PlanLibrary(robot, Path("nowhere")).find(task)
    assert plan is not None
    return reference_table(plan, robot, STAND), robot


def rotation_of(name: str) -> tuple[FlightRotation, JumpTable]:
    table, robot = table_of(name)
    found = flight_rotation(table, robot)
    assert found is not None
    return found, table


@pytest.mark.parametrize("name", ["somersault", "somersault_forward_35cm"])
def test_in_the_tuck_the_rate_is_that_of_the_body(name: str) -> None:
    """Where no joint moves the whole robot turns like its base."""
    rotation, table = rotation_of(name)
    lasts = table.touchdown_time - table.lift_off_time
    assert rotation.time[0] == pytest.approx(table.lift_off_time)
    assert rotation.time[-1] == pytest.approx(table.touchdown_time)
    middle = table.lift_off_time + 0.5 * lasts
    body = np.interp(middle, table.time, table.columns["angular_velocity"][:, 1])
    assert np.interp(middle, rotation.time, rotation.rate) == pytest.approx(body, rel=0.01)
    tucked, out, greatest, direction = rotation.marks
    assert table.lift_off_time < tucked < middle < out < table.touchdown_time
    assert greatest == rotation.rate.max()
    assert direction == 1.0


def test_what_is_left_is_the_integral_of_the_rate_and_nearly_a_turn() -> None:
    rotation, _ = rotation_of("somersault")
    assert rotation.left[-1] == 0.0
    change = np.diff(rotation.left)
    middle = 0.5 * (rotation.rate[1:] + rotation.rate[:-1])
    assert change == pytest.approx(-middle * np.diff(rotation.time))
    assert 300.0 < np.degrees(rotation.left[0]) < 360.0


def test_backwards_the_rate_is_positive_and_the_direction_is_not() -> None:
    rotation, _ = rotation_of("somersault_backward_35cm")
    assert rotation.marks[3] == -1.0
    assert rotation.rate.min() > 0.0


@pytest.mark.long
@pytest.mark.parametrize("name", ["forward_38cm", "turn_180deg", "hops_10"])
def test_no_other_jump_has_one(name: str) -> None:
    assert flight_rotation(*table_of(name)) is None
