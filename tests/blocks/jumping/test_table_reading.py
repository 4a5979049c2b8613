"""Reading a plan: rows, what lies between them, and the phase by time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aloft.blocks.jumping.table_reading import locate, planned_phase, read_table
from aloft.blocks.signals import JumpReference, Phase
from aloft.planner.library.jump_table import JumpTable, table_rows
from aloft.robots.description import find_robot

TIMES = np.array([0.0, 0.1, 0.1, 0.4])


@pytest.mark.parametrize(
    ("time", "row", "share"),
    [(-1.0, 0, 0.0), (0.0, 0, 0.0), (0.05, 0, 0.5), (0.1, 2, 0.0), (0.25, 2, 0.5), (9.0, 2, 1.0)],
)
def test_locate(time, row, share):
    assert locate(TIMES, time) == (row, pytest.approx(share))


def test_an_instant_with_two_rows_takes_the_second():
    rows = np.array([1.0, 2.0, 5.0, 6.0])
    row, share = locate(TIMES, 0.1)
    assert rows[row] + share * (rows[row + 1] - rows[row]) == 5.0


def test_phases_begin_at_their_times():
    marks = (1.0, 2.0, 3.0, 4.0, 5.0)
    for phase in range(6):
        assert planned_phase(phase, *marks) == phase
        assert planned_phase(phase + 0.999, *marks) == phase


def table():
    robot = find_robot("bruce")
    fields = JumpReference.allocate(robot.dimensions).views()
    skip = {"time", "phase", "lift_off_time", "touchdown_time", "contact", "toes_first"}
    columns = {
        name: np.stack([np.full(view.shape, value) for value in (1.0, 3.0)])
        for name, view in fields.items()
        if name not in skip
    }
    columns["orientation"] = np.array([[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
    return JumpTable(np.array([0.0, 1.0]), columns, 0.1, 0.2, 0.3, 0.6, 0.8)


def read(
    plan: JumpTable, reference: JumpReference, time: float, lead: float = 0.0, hold: float = 0.0
) -> None:
    read_table(table_rows(plan), time, lead, hold, reference)


def test_it_is_known_before_touchdown_whether_the_toes_land_first():
    reference = JumpReference.allocate(find_robot("bruce").dimensions)
    whole = table()
    times = np.array([0.0, 0.3, 0.6, 0.6, 0.65, 0.7, 1.0])
    columns = {name: np.repeat(column[:1], 7, axis=0) for name, column in whole.columns.items()}
    stands, toes, none = [True] * 4, [True, False] * 2, [False] * 4
    rows = {True: [stands, stands, none, toes, toes, stands, stands],
            False: [toes, toes, none, stands, stands, stands, stands]}  # fmt: skip
    for toes_first, contact in rows.items():
        planned = replace(whole, time=times, columns=columns, contact=np.array(contact))
        for time in (0.0, 0.45, 0.59, 0.9):
            read(planned, reference, time)
            assert bool(reference.toes_first) is toes_first
    read(whole, reference, 0.45)
    assert not reference.toes_first, "where nothing is said all points land"


def test_reading_interpolates_every_field_and_normalises_the_orientation():
    reference = JumpReference.allocate(find_robot("bruce").dimensions)
    read(table(), reference, 0.25)
    assert reference.com.tolist() == [1.5, 1.5, 1.5]
    assert (reference.joint_velocity == 1.5).all()
    assert reference.orientation == pytest.approx(np.array([0.25, 0.0, 0.0, 0.75]) / 0.625**0.5)
    assert (float(reference.time), int(reference.phase)) == (0.25, Phase.THRUST)
    assert (float(reference.lift_off_time), float(reference.touchdown_time)) == (0.3, 0.6)


@pytest.mark.parametrize(
    ("time", "contact"), [(0.29, True), (0.3, False), (0.59, False), (0.6, True)]
)
def test_points_are_planned_in_contact_outside_flight(time, contact):
    reference = JumpReference.allocate(find_robot("bruce").dimensions)
    read(table(), reference, time)
    assert reference.contact.tolist() == [contact] * 4


def test_several_jumps():
    """Flights 0.3-0.6 and 0.8-1.0, thrust between them from 0.7 on."""
    one = table()
    reference = JumpReference.allocate(find_robot("bruce").dimensions)
    row = replace(one, recover_time=1.2, later_jumps=((0.7, 0.8, 1.0),))
    seen = {}
    for k in range(130):
        read(row, reference, k / 100 + 1e-6)
        seen[k] = int(reference.phase)
        second = k >= 45
        assert float(reference.lift_off_time) == (0.8 if second else 0.3), k
        assert float(reference.touchdown_time) == (1.0 if second else 0.6), k
        assert reference.contact.all() == (seen[k] != Phase.FLIGHT)
    changes = [(k, seen[k]) for k in range(1, 130) if seen[k] != seen[k - 1]]
    assert changes == [(10, 1), (20, 2), (30, 3), (60, 4), (70, 2), (80, 3), (100, 4), (120, 5)]


def test_contacts_of_a_table_hold_on_the_ground():
    contact = np.array([[True, False, True, False], [True] * 4])
    reference = JumpReference.allocate(find_robot("bruce").dimensions)
    plan = replace(table(), contact=contact)
    read(plan, reference, 0.25)
    assert reference.contact.tolist() == [True, False, True, False]
    read(plan, reference, 0.45)
    assert not reference.contact.any()


def test_what_is_held_is_the_mean_over_the_time_it_is_held():
    """Also over an instant with two rows, and beyond the table's ends."""
    plan = table()
    times = np.array([0.0, 0.5, 0.5, 1.0])
    push = np.array([2.0, 4.0, -9.0, -9.0])
    columns = {
        name: np.stack([np.full(rows.shape[1:], value) for value in push])
        for name, rows in plan.columns.items()
        if name != "orientation"
    }
    columns["orientation"] = np.tile([0.0, 0.0, 0.0, 1.0], (4, 1))
    reference = JumpReference.allocate(find_robot("bruce").dimensions)
    plan = replace(plan, time=times, columns=columns)
    fine = np.linspace(-0.2, 1.4, 1600001)
    value = np.interp(fine, [0.0, 0.5, 0.5 + 1e-9, 1.0], push)
    for time, lead, hold in [
        (0.1, 0.0, 0.1),
        (0.42, 0.05, 0.1),
        (0.95, 0.0, 0.2),
        (-0.15, 0.0, 0.3),
    ]:
        read(plan, reference, time, lead, hold)
        begin = time + lead
        mean = value[(fine >= begin) & (fine <= begin + hold)].mean()
        np.testing.assert_allclose(reference.com_acceleration, mean, atol=2e-4)
        np.testing.assert_allclose(reference.joint_torque, mean, atol=2e-4)
    read(plan, reference, 0.25, 0.0, 0.1)
    np.testing.assert_allclose(reference.com, 3.0, err_msg="what is not fed forward is of now")
