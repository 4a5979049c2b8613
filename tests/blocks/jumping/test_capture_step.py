"""When a foot steps after touchdown, which one, where to, and what becomes of the phase."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aloft.blocks.jumping.capture_step import (
    CaptureStep,
    choose_foothold,
    find_capture_point,
    swing_points,
)
from aloft.blocks.signals import Phase
from aloft.mathematics.constants import GRAVITY
from aloft.runtime.testing import BlockBench

from ...kernel_samples import records

PERIOD = 0.002
POINTS = np.array([
    [0.0425, -0.076, 0.0], [-0.0425, -0.076, 0.0], [0.0425, 0.076, 0.0], [-0.0425, 0.076, 0.0],
])  # fmt: skip


def make(steps=2, **params):
    bench = BlockBench(CaptureStep, {"steps": steps, **params}, robot="bruce", rate=1 / PERIOD)
    bench.set("reference", time=2.0, lift_off_time=1.0, touchdown_time=1.3)
    bench.set(
        "terms",
        contact_position=POINTS,
        foot_position=[[0.0, -0.076, 0.0], [0.0, 0.076, 0.0]],
        foot_rotation=[np.eye(3)] * 2,
        com=[0.0, 0.0, 0.25],
    )
    bench.now = 0.0
    return bench


def run(bench, until, *, velocity=(0.0, 0.0), stance=(True,) * 4, landing_time=0.35):
    """Step to a time after touchdown; returns whether each point stepped in each tick."""
    bench.set("terms", com_velocity=[*velocity, 0.0])
    seen = []
    while bench.now < until - 1e-9:
        recovers = bench.now >= landing_time
        bench.set(
            "before",
            phase=Phase.RECOVER if recovers else Phase.LANDING,
            time_in_phase=bench.now - landing_time if recovers else bench.now,
            time_since_touchdown=bench.now,
            stance=stance,
        )
        bench.step()
        seen.append(bench.get("phase").stepping.tolist())
        bench.now = round(bench.now + PERIOD, 6)
    return seen


def test_without_steps_the_phase_is_passed_on():
    bench = make(steps=0)
    assert not np.any(run(bench, 0.5, velocity=(-1.0, 0.0)))
    out = bench.get("phase")
    assert int(out.phase) == Phase.RECOVER and out.stance.all()
    assert float(out.time_since_touchdown) == pytest.approx(0.498)
    assert float(out.time_in_phase) == pytest.approx(0.148)


def test_a_supported_robot_takes_no_step():
    bench = make()
    assert not np.any(run(bench, 0.6, velocity=(-0.25, 0.1)))


def test_no_step_right_after_touchdown_nor_before_another_jump():
    bench = make(after=0.08)
    assert not np.any(run(bench, 0.08, velocity=(-0.8, 0.0)))
    bench.set("reference", time=2.0, lift_off_time=3.0)
    assert not np.any(run(bench, 0.3, velocity=(-0.8, 0.0)))
    bench.set("reference", time=2.0, lift_off_time=1.0)
    assert np.any(run(bench, 0.34, velocity=(-0.8, 0.0)))


def test_a_robot_that_stands_on_one_foot_waits_for_the_other():
    bench = make(seek_speed=0.0)
    assert not np.any(run(bench, 0.3, velocity=(-0.8, 0.0), stance=(True, True, False, False)))


@pytest.mark.parametrize(
    ("velocity", "foot"),
    [
        ((-0.6, 0.15), 0),  # the robot falls over its left heel: the right foot is free
        ((-0.6, -0.15), 1),
        ((0.7, 0.15), 0),
        ((0.0, 0.45), 1),  # it falls to the left, beyond its left foot, which must go farther
        ((0.0, -0.45), 0),
    ],
)
def test_which_foot_steps_and_that_the_other_stands(velocity, foot):
    bench = make()
    if velocity[0] == 0.0:  # its feet are close together
        bench.set("terms", contact_position=POINTS * [1.0, 0.6, 1.0])
        bench.set("terms", foot_position=[[0.0, -0.046, 0.0], [0.0, 0.046, 0.0]])
    seen = run(bench, 0.12, velocity=velocity)
    assert np.any(seen)
    out = bench.get("phase")
    assert out.stepping.tolist() == [foot == 0] * 2 + [foot == 1] * 2
    assert out.stance.tolist() == [foot == 1] * 2 + [foot == 0] * 2
    assert out.step_acceleration[~out.stepping].tolist() == [[0.0] * 3] * 2
    pushed = out.step_acceleration[out.stepping]
    assert (pushed[:, 2] > 1.0).all()  # it rises
    along = 0 if abs(velocity[0]) > abs(velocity[1]) else 1
    assert (np.sign(pushed[:, along]) == np.sign(velocity[along])).all()


def test_a_heel_that_hovers_carries_nothing_while_the_other_foot_steps():
    for heel, stands in ((0.0004, True), (0.003, False)):
        bench = make(flat=0.0005)
        points = POINTS.copy()
        points[3, 2] = heel  # of the left foot
        bench.set("terms", contact_position=points)
        run(bench, 0.08, velocity=(-0.6, 0.15))
        assert bench.get("phase").stance.all()  # no foot steps yet
        run(bench, 0.12, velocity=(-0.6, 0.15))
        out = bench.get("phase")
        assert out.stepping.tolist() == [True, True, False, False]
        assert out.stance.tolist() == [False, False, True, stands]


def test_a_step_ends_at_contact_and_there_are_no_more_than_allowed():
    bench = make(steps=1, duration=0.13)
    run(bench, 0.12, velocity=(-0.6, 0.15))
    assert bench.get("phase").stepping.any()
    seen = run(bench, 1.0, velocity=(-0.6, 0.15))  # its points keep their contact
    ended = [np.any(tick) for tick in seen].index(False)
    began = 0.084
    assert 0.12 + ended * PERIOD - began == pytest.approx(0.6 * 0.13, abs=0.006)
    assert not np.any(seen[ended:])


def test_a_foot_that_finds_no_ground_stops_stepping():
    bench = make(steps=1, duration=0.1, seek_speed=0.0)
    run(bench, 0.12, velocity=(-0.6, 0.15))
    seen = run(bench, 0.4, velocity=(-0.6, 0.15), stance=(False, False, True, True))
    assert sum(np.any(tick) for tick in seen) == pytest.approx(0.15 / PERIOD - 18, abs=3)


def test_it_stays_low_until_it_has_settled_and_then_recovers_from_the_start():
    bench = make(steps=1, duration=0.13, settle=0.35)
    run(bench, 0.30)
    run(bench, 0.44, velocity=(-0.6, 0.15))
    out = bench.get("phase")
    assert int(out.phase) == Phase.LANDING
    run(bench, 0.70)
    assert int(out.phase) == Phase.LANDING
    assert float(out.time_in_phase) == pytest.approx(0.698)
    run(bench, 0.85)
    assert int(out.phase) == Phase.RECOVER
    assert 0.0 < float(out.time_in_phase) < 0.2


def test_another_flight_forgets_the_steps():
    bench = make(steps=1)
    run(bench, 0.4, velocity=(-0.6, 0.15))
    bench.set("before", phase=Phase.FLIGHT, stance=False)
    bench.step()
    assert not bench.get("phase").stepping.any()
    bench.now = 0.0
    assert np.any(run(bench, 0.12, velocity=(-0.6, 0.15)))


SOLES = np.array([[0.05, -0.08, 0.0], [-0.04, -0.08, 0.0], [0.05, 0.08, 0.0], [-0.04, 0.08, 0.0]])
FOOT = [0, 0, 1, 1]


def foothold(capture, rate, left, beyond):
    terms, params, constants, scratch = records(
        {"contact_position": SOLES},
        {"beyond": beyond},
        {"foot_of_point": FOOT, "side": [-1.0, 1.0]},
        {"capture": capture, "nearest": np.zeros(2), "other": np.zeros(2)},
    )
    out = np.zeros(3)
    choose_foothold(terms, params, constants, scratch, 1, rate, left, out)
    return out


HEIGHTS = np.array([0.01, 0.02, 0.04, 0.08])


@pytest.mark.parametrize(
    ("stance", "ground"),
    [
        ([True] * 4, 0.0375),
        ([False] * 4, 0.0375),
        ([True, False, False, False], 0.01),
        ([False, False, True, True], 0.06),
        ([False, True, False, False], 0.02),
    ],
)
@pytest.mark.parametrize(("mass", "counts"), [(5.5, 5.5), (0.0, 4.8)])
@pytest.mark.parametrize("foot", [0, 2])
def test_the_pendulum_stands_on_the_points_in_stance(stance, ground, mass, counts, foot):
    points, matrix = SOLES.copy(), np.zeros((16, 16))
    points[:, 2], matrix[0, 0] = HEIGHTS, mass
    before, terms, params, constants, memory, scratch = records(
        {"stance": stance},
        {
            "contact_position": points, "com": [0.02, -0.03, 0.31], "com_velocity": [-0.4, 0.2, 0.0],
            "angular_momentum": [0.1, -0.3, 0.7], "mass_matrix": matrix,
        },
        {"turn": 0.6},
        {"mass": 4.8},
        {"foot": foot, "ground": 9.0},
        {"capture": np.zeros(2)},
    )  # fmt: skip
    rate = find_capture_point(before, terms, params, constants, memory, scratch)
    assert rate == pytest.approx(math.sqrt(GRAVITY / (0.31 - ground)), rel=1e-12)
    arm = 0.6 * rate / (counts * GRAVITY)
    expected = [0.02 - 0.4 / rate - 0.3 * arm, -0.03 + 0.2 / rate - 0.1 * arm]
    assert scratch.capture == pytest.approx(expected, rel=1e-12)
    # while a foot steps, the ground is where the feet stood before
    assert float(memory.ground) == pytest.approx(9.0 if foot else ground, rel=1e-12)


def test_the_foothold_is_where_the_capture_point_will_be():
    xi, rate, left = np.array([-0.09, 0.02]), 6.0, 0.13
    out = foothold(xi, rate, left, 0.0)
    push, place, dt = np.array([-0.04, -0.08]), xi.copy(), 1e-5
    for _ in range(round(left / dt)):
        place += dt * rate * (place - push)
    assert out[:2] == pytest.approx(place, abs=1e-4)
    farther = foothold(xi, rate, left, 0.5)
    assert farther[:2] - push == pytest.approx(1.5 * (out[:2] - push))


def test_the_swinging_foot_rises_lands_flat_and_turns_to_its_heading():
    goal, heading, dt = np.array([-0.1, 0.1, 0.0]), 0.1, 1e-4
    terms, params, constants, memory, out = records(
        {"contact_position": SOLES, "contact_velocity": np.zeros((4, 3))},
        {"duration": 0.13, "height": 0.015},
        {"foot_of_point": FOOT, "offset": [[0.045, 0.0, 0.0], [-0.045, 0.0, 0.0]] * 2},
        {"elapsed": 0.0, "heading": heading, "foothold": [np.zeros(3), goal]},
        {
            "stance": np.ones(4, bool), "stepping": np.zeros(4, bool),
            "step_acceleration": np.zeros((4, 3)),
        },
    )  # fmt: skip
    position, velocity = terms.contact_position, terms.contact_velocity
    highest = 0.0
    for step in range(1100):
        memory.elapsed[()] = step * dt
        swing_points(terms, params, constants, memory, out, 1)
        velocity += dt * out.step_acceleration
        position += dt * velocity
        highest = max(highest, float(position[2, 2]))
    assert out.stance.tolist() == [True, True, False, False] == (~out.stepping).tolist()
    assert (position[:2] == SOLES[:2]).all()
    assert 0.012 < highest < 0.016
    assert velocity[2:, 2].max() < -0.1  # it meets the ground moving
    ahead = position[2, :2] - position[3, :2]
    assert position[2:, :2].mean(axis=0) == pytest.approx(goal[:2], abs=0.01)
    assert math.atan2(ahead[1], ahead[0]) == pytest.approx(heading, abs=0.02)


def test_a_foot_that_has_not_touched_seeks_the_ground():
    for speed in (0.0, 0.8):
        bench = make(steps=0, seek_speed=speed, seek_damping=50.0)
        bench.set("terms", contact_velocity=[[0, 0, 0], [0, 0, 0], [0.1, 0, -0.3], [0.1, 0, -1.0]])
        bench.set("reference", time=2.0, lift_off_time=3.0)  # also where another jump follows
        seen = run(bench, 0.01, stance=(True, False, False, False))
        out = bench.get("phase")
        assert np.all(seen == np.array([False, False, speed > 0.0, speed > 0.0]))
        assert out.stance.tolist() == [True, False, False, False]
        assert not out.step_acceleration[:2].any()
        if speed > 0.0:
            wanted = [[-5.0, 0.0, -25.0], [-5.0, 0.0, 10.0]]
            assert out.step_acceleration[2:] == pytest.approx(np.array(wanted))


def test_no_foot_seeks_the_ground_while_none_stands_nor_after_the_landing():
    bench = make(steps=0, seek_speed=0.8)
    assert not np.any(run(bench, 0.3, stance=(False,) * 4))
    assert not np.any(run(bench, 0.6, stance=(True, True, False, False), landing_time=0.0))


def test_a_foot_that_the_plan_lands_later_follows_the_plan_until_then():
    bench = make(steps=0)
    bench.set("terms", contact_velocity=[[0, 0, 0], [0, 0, 0], [0.1, 0, -0.5], [0.1, 0, -0.5]])
    planned = {"foot_position": [[0, -0.1, 0.01], [0, 0.1, 0.03]], "foot_velocity": [[0, 0, 0], [0.1, 0, -0.4]]}  # fmt: skip
    bench.set("reference", contact=[True, True, False, False], **planned)
    run(bench, PERIOD, stance=(True, True, False, False))
    out = bench.get("phase")
    assert out.stepping.tolist() == [False, False, True, True]
    for point in (2, 3):  # 2 cm of height and 0.1 m/s are missing
        wanted = [0.0, 0.0, 3000.0 * 0.02 + 110.0 * 0.1]
        assert out.step_acceleration[point] == pytest.approx(np.array(wanted))
    bench.set("reference", contact=[True, True, True, True], **planned)
    run(bench, 2 * PERIOD, stance=(True, True, False, False))
    assert bench.get("phase").step_acceleration[2] == pytest.approx(np.array([-2.0, 0.0, -10.0]))
