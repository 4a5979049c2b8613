"""Every transition of the phase machine, the stance points, and the time to touchdown."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.blocks.jumping.jump_phase import (
    TABLE,
    TRANSITIONS,
    JumpPhase,
    PhaseCondition,
    find_conditions,
    next_phase,
    time_to_height,
)
from aloft.blocks.signals import Phase
from aloft.runtime.testing import BlockBench

LIFT_OFF, TOUCHDOWN = 0.5, 0.8
SPEED = 9.81 * 0.15
HEIGHT = 0.3


def make(**params):
    bench = BlockBench(JumpPhase, params, robot="bruce", rate=500.0)
    bench.set("reference", lift_off_time=LIFT_OFF, touchdown_time=TOUCHDOWN)
    bench.set("contacts", active=True)
    bench.now = 0.0
    return bench


def planned(now):
    marks = (0.1, 0.3, LIFT_OFF, TOUCHDOWN, 1.0)
    return sum(now >= mark - 1e-9 for mark in marks)


def run(bench, until, *, active=None, fall=True):
    """Step to a time with the body where the plan has it."""
    if active is not None:
        bench.set("contacts", active=active)
    seen = []
    while bench.now < until - 1e-9:
        t = min(max(bench.now - LIFT_OFF, 0.0), 0.3)
        com = [0.0, 0.0, HEIGHT + t * (SPEED - 4.905 * t)]
        velocity = [0.0, 0.0, SPEED - 9.81 * t if fall else 0.0]
        bench.set(
            "reference", time=bench.now, phase=planned(bench.now), com=com, com_velocity=velocity
        )
        bench.set("terms", com=com, com_velocity=velocity)
        bench.step()
        seen.append(int(bench.get("phase").phase))
        bench.now = round(bench.now + 0.002, 6)
    return seen


def phase(bench):
    return int(bench.get("phase").phase)


def test_a_jump_by_the_plan():
    bench = make()
    seen = run(bench, LIFT_OFF)
    seen += run(bench, TOUCHDOWN - 0.001, active=False)
    seen += run(bench, 2.0, active=True)
    changes = [seen[0]] + [b for a, b in pairwise(seen) if a != b]
    assert changes == [
        Phase.STAND, Phase.SQUAT, Phase.THRUST, Phase.FLIGHT, Phase.LANDING, Phase.RECOVER,
    ]  # fmt: skip
    assert seen.index(Phase.FLIGHT) == 250
    out = bench.get("phase")
    assert float(out.time_since_touchdown) == pytest.approx(2.0 - 0.002 - 0.8, abs=0.003)
    assert float(out.time_in_phase) == pytest.approx(
        float(out.time_since_touchdown) - 0.35, abs=3e-3
    )


def test_predicted_touchdown_is_the_planned_one_on_the_plan():
    bench = make()
    run(bench, LIFT_OFF)
    run(bench, 0.6, active=False)
    assert float(bench.get("phase").time_to_touchdown) == pytest.approx(0.8 - 0.598, abs=1e-9)


def test_contact_in_the_first_half_of_flight_is_not_touchdown():
    bench = make()
    run(bench, 0.64)
    assert phase(bench) == Phase.FLIGHT
    run(bench, 0.66)
    assert phase(bench) == Phase.LANDING


def test_early_lift_off_only_in_the_second_half_of_the_thrust():
    bench = make(early_lift_off=0.01)
    run(bench, 0.35)
    run(bench, 0.39, active=False)
    assert phase(bench) == Phase.THRUST
    run(bench, 0.42)
    assert phase(bench) == Phase.FLIGHT


def test_late_lift_off_waits_for_the_feet_but_not_for_ever():
    bench = make(late_lift_off=0.02)
    run(bench, 0.51)
    assert phase(bench) == Phase.THRUST
    run(bench, 0.514, active=False)
    assert phase(bench) == Phase.FLIGHT
    bench = make(late_lift_off=0.02)
    run(bench, 0.524)
    assert phase(bench) == Phase.FLIGHT


def test_heels_rise_before_lift_off_where_the_plan_says_so():
    bench, toes = make(late_lift_off=0.01), [True, False, True, False]
    bench.set("reference", contact=True)
    run(bench, 0.4)
    assert bench.get("phase").stance.all()
    bench.set("reference", contact=toes)
    run(bench, LIFT_OFF)
    assert bench.get("phase").stance.tolist() == toes
    bench.set("reference", contact=False)  # the plan flies, the robot does not yet
    run(bench, LIFT_OFF + 0.006)
    assert phase(bench) == Phase.THRUST
    assert bench.get("phase").stance.tolist() == toes
    run(bench, LIFT_OFF + 0.016)
    assert phase(bench) == Phase.FLIGHT
    assert not bench.get("phase").stance.any()


def test_a_flight_without_end_is_a_fault_for_good():
    bench = make(lost_contact=0.2)
    run(bench, LIFT_OFF)
    run(bench, 1.0, active=False)
    assert phase(bench) == Phase.FLIGHT
    run(bench, 1.01)
    assert phase(bench) == Phase.FAULT
    run(bench, 1.2, active=True)
    assert phase(bench) == Phase.FAULT


def test_standing_on_nothing_is_a_fault():
    bench = make(lost_contact=0.1)
    run(bench, 0.096, active=False)
    assert phase(bench) == Phase.STAND
    run(bench, 0.11)
    assert phase(bench) == Phase.FAULT


def test_losing_the_ground_after_landing_is_a_fault():
    bench = make()
    run(bench, LIFT_OFF)
    run(bench, 0.78, active=False)
    run(bench, 0.8, active=True)
    assert phase(bench) == Phase.LANDING
    run(bench, 1.01, active=False)
    assert phase(bench) == Phase.FAULT


def test_stance_points():
    bench = make(contact_hold=0.01, flat_height=0.0)
    run(bench, 0.4, active=[True, False, True, True])
    assert bench.get("phase").stance.tolist() == [True] * 4
    run(bench, LIFT_OFF)
    run(bench, 0.7, active=False)
    assert bench.get("phase").stance.tolist() == [False] * 4
    run(bench, 0.71, active=[False, True, False, False])
    assert bench.get("phase").stance.tolist() == [False, True, False, False]
    run(bench, 0.714, active=[True, False, False, False])
    assert bench.get("phase").stance.tolist() == [True, True, False, False]
    run(bench, 0.726)
    assert bench.get("phase").stance.tolist() == [True, False, False, False]
    run(bench, 0.8, active=False)
    assert bench.get("phase").stance.tolist() == [True, False, False, False]


@given(st.floats(0.0, 1.0), st.floats(-3.0, 3.0), st.floats(0.0, 0.5))
def test_time_to_height_solves_the_fall(height, velocity, goal):
    time = time_to_height(height, velocity, goal)
    apex = height + max(velocity, 0.0) ** 2 / 19.62
    assert time >= 0.0
    if goal <= apex - 1e-6 and (velocity >= 0.0 or goal <= height):
        assert height + velocity * time - 4.905 * time**2 == pytest.approx(goal, abs=1e-9)
    assert np.isfinite(time)


def test_state_is_all_there_is():
    bench = make()
    run(bench, 0.45)
    snapshot, now = bench.snapshot(), bench.now
    first = run(bench, 0.6)
    bench.restore(snapshot)
    bench.now = now
    assert run(bench, 0.6) == first


def test_a_foot_that_is_nearly_flat_stands_as_a_whole():
    bench = make(flat_height=0.005)
    run(bench, LIFT_OFF)
    run(bench, 0.7, active=False)
    place = np.zeros((4, 3))
    place[:, 2] = [0.1, 0.104, 0.1, 0.101]
    bench.set("terms", contact_position=place)
    run(bench, 0.71, active=[True, False, False, False])
    assert bench.get("phase").stance.tolist() == [True, True, False, False]
    place[1, 2] = 0.106
    bench.set("terms", contact_position=place)
    run(bench, 0.72, active=[True, False, False, True])
    assert bench.get("phase").stance.tolist() == [True, False, True, True]


def hop_twice(bench, *, landed, until):
    """Two flights, 0.5-0.8 s and 1.0-1.3 s, thrust between them from 0.9 s on; the feet touch
    the ground at ``landed`` after the first."""
    marks = ((0.1, 1), (0.3, 2), (0.5, 3), (0.8, 4), (0.9, 2), (1.0, 3), (1.3, 4))
    seen = []
    while bench.now < until - 1e-9:
        # From the middle of the first flight on the reference names the second.
        times = (0.5, 0.8) if bench.now < 0.65 else (1.0, 1.3)
        bench.set("reference", lift_off_time=times[0], touchdown_time=times[1], time=bench.now)
        bench.set("reference", phase=[p for mark, p in ((0.0, 0), *marks) if bench.now >= mark][-1])
        start = 0.5 if bench.now < 0.9 else 1.0
        t = min(max(bench.now - start, 0.0), 0.3)
        com, speed = [0.0, 0.0, HEIGHT + t * (SPEED - 4.905 * t)], [0.0, 0.0, SPEED - 9.81 * t]
        bench.set("reference", com=com, com_velocity=speed)
        bench.set("terms", com=com, com_velocity=speed)
        on_ground = bench.now < 0.5 or landed <= bench.now < 1.0 or bench.now >= 1.3
        bench.set("contacts", active=on_ground)
        bench.step()
        seen.append(int(bench.get("phase").phase))
        bench.now = round(bench.now + 0.002, 6)
    return seen


@pytest.mark.parametrize("landed", [0.77, 0.8, 0.83])
def test_another_flight_follows_where_the_plan_has_one(landed):
    seen = hop_twice(make(), landed=landed, until=2.0)
    changes = [b for a, b in pairwise(seen) if a != b]
    assert changes == [
        Phase.SQUAT, Phase.THRUST, Phase.FLIGHT, Phase.LANDING, Phase.THRUST, Phase.FLIGHT,
        Phase.LANDING, Phase.RECOVER,
    ]  # fmt: skip
    assert seen.index(Phase.LANDING) == pytest.approx(landed / 0.002, abs=1)
    assert seen[450] == Phase.THRUST, "by the plan, whenever it landed"


def test_a_landing_that_comes_after_the_thrust_waits_for_no_second_flight():
    bench = make()
    seen = hop_twice(bench, landed=1.3, until=2.5)
    assert seen[-1] == Phase.FAULT
    assert Phase.RECOVER not in seen


def test_all_points_are_in_stance_in_the_second_thrust():
    bench = make()
    hop_twice(bench, landed=0.8, until=0.95)
    assert phase(bench) == Phase.THRUST
    assert bench.get("phase").stance.all()
    assert float(bench.get("phase").time_since_touchdown) == pytest.approx(0.148, abs=3e-3)


def test_with_a_delay_the_landing_begins_before_its_predicted_touchdown_without_contact():
    bench = make(early_landing=1.0)
    bench.set("delay", ahead=0.006)
    run(bench, LIFT_OFF)
    run(bench, TOUCHDOWN - 0.006, active=False)
    assert phase(bench) == Phase.FLIGHT
    run(bench, TOUCHDOWN - 0.003)
    assert phase(bench) == Phase.LANDING
    assert bench.get("phase").stance.all(), "all points, until one has contact"
    bench.set("contacts", active=[True, False, False, False])
    bench.set("terms", contact_position=np.outer([0.0, 0.02, 0.05, 0.05], [0.0, 0.0, 1.0]))
    run(bench, TOUCHDOWN)
    assert bench.get("phase").stance.tolist() == [True, False, False, False]


@pytest.mark.parametrize("ahead", [0.0, 0.001])
def test_with_a_short_delay_it_waits_for_the_contact(ahead):
    bench = make()
    bench.set("delay", ahead=ahead)
    run(bench, LIFT_OFF)
    run(bench, TOUCHDOWN + 0.02, active=False)
    assert phase(bench) == Phase.FLIGHT


def test_a_landing_that_never_finds_the_ground_is_a_fault():
    """The time without contact counts from its beginning: the flight before was no loss of contact."""
    bench = make(lost_contact=0.1)
    bench.set("delay", ahead=0.006)
    run(bench, LIFT_OFF)
    run(bench, TOUCHDOWN + 0.09, active=False)
    assert phase(bench) == Phase.LANDING
    run(bench, TOUCHDOWN + 0.11)
    assert phase(bench) == Phase.FAULT


LIMITS = np.array([0.02, 0.01, 0.5, 0.35, 0.2, 1.5, 0.3])


def conditions(
    now=0.0, in_phase=0.0, lift_off=1.0, touchdown=1.3, remaining=0.0, unloaded=0.0,
    planned=Phase.STAND, another=False, limits=LIMITS, ahead=0.0, stood=0.0,
):  # fmt: skip
    holds = np.zeros(len(PhaseCondition), bool)
    times = np.array([now, in_phase, lift_off, touchdown, remaining, unloaded, ahead, stood])
    find_conditions(times, limits, int(planned), another, holds)
    return {condition for condition in PhaseCondition if holds[condition]}


@pytest.mark.parametrize(
    "transition", TRANSITIONS, ids=lambda t: f"{t.phase.name}-{t.condition.name}"
)
def test_each_transition_is_taken_when_it_alone_applies(transition):
    holds = np.zeros(len(PhaseCondition), bool)
    assert next_phase(TABLE, int(transition.phase), holds) == transition.phase
    holds[transition.condition] = True
    assert next_phase(TABLE, int(transition.phase), holds) == transition.following


def test_of_several_the_first_in_the_table_is_taken():
    holds = np.ones(len(PhaseCondition), bool)
    found = {phase: Phase(next_phase(TABLE, int(phase), holds)) for phase in Phase}
    assert found == {
        Phase.HANG: Phase.STAND,
        Phase.STAND: Phase.FAULT, Phase.SQUAT: Phase.FAULT, Phase.THRUST: Phase.FAULT,
        Phase.FLIGHT: Phase.LANDING, Phase.LANDING: Phase.FAULT, Phase.RECOVER: Phase.FAULT,
        Phase.FAULT: Phase.FAULT,
    }  # fmt: skip


def test_every_phase_but_the_first_can_be_reached():
    assert {t.following for t in TRANSITIONS} == set(Phase) - {Phase.HANG}


def test_when_the_conditions_hold():
    C = PhaseCondition
    assert conditions() == {C.TOUCHED_DOWN}
    assert C.PLAN_SQUATS in conditions(planned=Phase.SQUAT)
    assert C.PLAN_THRUSTS not in conditions(planned=Phase.SQUAT)
    assert {C.PLAN_SQUATS, C.PLAN_THRUSTS} <= conditions(planned=Phase.FLIGHT)
    assert C.LIFT_OFF_DUE not in conditions(now=1.01)
    assert C.LIFT_OFF_DUE in conditions(now=1.01, unloaded=0.002)
    assert C.LIFT_OFF_DUE in conditions(now=1.03)
    assert C.LEFT_EARLY in conditions(now=0.95, in_phase=0.1, unloaded=0.01)
    assert C.LEFT_EARLY not in conditions(now=0.85, in_phase=0.1, unloaded=0.01)
    assert C.TOUCHED_DOWN not in conditions(in_phase=0.1, remaining=0.2)
    assert C.TOUCHED_DOWN in conditions(in_phase=0.16, remaining=0.1)
    assert C.TOUCHED_DOWN not in conditions(in_phase=0.2, remaining=0.1, unloaded=0.002)
    assert C.TOUCHED_DOWN in conditions(in_phase=0.2, remaining=0.005, unloaded=0.2, ahead=0.004)
    assert C.TOUCHED_DOWN not in conditions(
        in_phase=0.2, remaining=0.007, unloaded=0.2, ahead=0.004
    )
    assert C.TOUCHED_DOWN not in conditions(
        in_phase=0.2, remaining=0.001, unloaded=0.2, ahead=0.001
    )
    assert C.TOUCHED_DOWN not in conditions(remaining=0.005, unloaded=0.2, ahead=0.004)
    assert C.OVERDUE in conditions(in_phase=0.51, unloaded=0.5)
    assert C.OVERDUE not in conditions(in_phase=0.49, unloaded=0.5)
    assert C.RESTED in conditions(in_phase=0.35)
    assert C.RESTED not in conditions(in_phase=0.35, another=True)
    assert C.THRUSTS_AGAIN in conditions(planned=Phase.THRUST, another=True)
    assert C.THRUSTS_AGAIN not in conditions(planned=Phase.THRUST)
    assert C.LOST_CONTACT in conditions(unloaded=0.21)
    assert C.STANDS in conditions(stood=0.3) and C.STANDS not in conditions(stood=0.29)


def test_a_robot_that_is_put_down_stands_once_all_its_points_have_carried_load() -> None:
    bench = make(start="standing", stand_time=0.1)
    bench.set("reference", time=-0.002, phase=Phase.STAND, contact=True)

    def step(active: list[bool], ticks: int) -> list[int]:
        bench.set("contacts", active=active)
        seen = []
        for _ in range(ticks):
            bench.step()
            seen.append(phase(bench))
        return seen

    assert set(step([False] * 4, 500)) == {Phase.HANG}
    assert not bench.get("phase").stance.any()
    assert set(step([True, True, False, True], 500)) == {Phase.HANG}
    assert set(step([True] * 4, 40)) == {Phase.HANG}
    assert set(step([True, False, True, True], 1)) == {Phase.HANG}
    seen = step([True] * 4, 52)
    assert seen[48] == Phase.HANG and seen[51] == Phase.STAND
    assert bench.get("phase").stance.all()
