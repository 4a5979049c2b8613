"""The law ``predicted``: the capture point, the torso's tilt, the planned place, and the lead."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.blocks.control.dynamics import Dynamics
from aloft.blocks.jumping.landing_heuristic import LandingHeuristic
from aloft.blocks.signals import Phase
from aloft.mathematics.constants import GRAVITY
from aloft.mathematics.landing_law import pull_to_position
from aloft.mathematics.rotations import to_matrix
from aloft.robots.description import find_robot
from aloft.robots.kinematics import standing_feet
from aloft.runtime.testing import BlockBench

from .test_landing_heuristic import LEVEL, fly, rotation_vector

ROBOT = find_robot("bruce")
MASS = ROBOT.total_mass


@given(*[st.floats(-0.2, 0.2)] * 4)
def test_of_the_way_from_the_planned_place_to_the_capture_point_a_share_is_taken_back(x, y, ox, oy):
    goal, miss = np.array([x, y, 0.3]), np.array([ox, oy, 0.1])
    pull_to_position(goal, miss, 0.5, 0.04)
    way = np.array([x + ox, y + oy])
    share = 0.5 / (1.0 + (np.linalg.norm(way) / 0.04) ** 4)
    assert goal[:2] == pytest.approx([x, y] - share * way, abs=1e-12)
    assert goal[2] == 0.3


def standing_terms():
    """The true dynamics of the standing robot."""
    standing = BlockBench(Dynamics, robot=ROBOT)
    standing.set("base", position=[0.0, 0.0, 0.37], orientation=LEVEL)
    standing.set("joints", position=ROBOT.standing_position)
    standing.step()
    return standing.get("terms")


def places():
    """Where the standing robot is."""
    terms = standing_terms()
    names = ("com", "foot_position", "contact_position", "base_position")
    return {name: getattr(terms, name) for name in names}


def predicting(**params):
    """In flight on the plan, 0.3 s before touchdown, with the true dynamics of the standing robot."""
    terms = standing_terms()
    params = {"law": "predicted", "place_gain": 0.0, "lead_time": 0.0, **params}
    bench = BlockBench(LandingHeuristic, params, robot=ROBOT)
    bench.set("terms", **{name: getattr(terms, name) for name in type(terms).fields})
    bench.set(
        "reference",
        phase=Phase.FLIGHT,
        com=terms.com,
        orientation=LEVEL,
        foot_position=terms.foot_position,
    )
    bench.set("phase", phase=Phase.FLIGHT, time_in_phase=0.0, time_to_touchdown=0.3)
    return bench, terms.foot_position - terms.com


def pushed(bench, linear, angular, tilt=(0.0, 0.0, 0.0)):
    """The landing places after an impulse; the momenta are as measured."""
    turn = np.zeros((3, 3))
    to_matrix(rotation_vector(tilt), turn)
    bench.set("terms", linear_momentum=linear, angular_momentum=angular, base_rotation=turn)
    return fly(bench, 0.0, 0.2).landing


def test_predicted_without_a_push_lands_where_planned():
    bench, planned = predicting()
    assert pushed(bench, np.zeros(3), np.zeros(3)) == pytest.approx(planned, abs=1e-4)


def test_predicted_without_a_price_on_tilt_is_the_capture_point():
    bench, planned = predicting(tilt_cost=[0.0, 0.0], clearance=0.0)
    moved = pushed(bench, [0.5, -0.3, 0.0], [0.03, 0.05, 0.0]) - planned
    rate = math.sqrt(GRAVITY / -float(standing_feet(ROBOT)[:, 2].mean()))
    linear, angular = 1.0 / (MASS * rate), rate / (MASS * GRAVITY)
    ahead, aside = linear * 0.5 + angular * 0.05, -linear * 0.3 - angular * 0.03
    expected = [0.75 * ahead, 0.5 * aside, 0.0]  # the shares of the way that the law goes
    assert moved == pytest.approx(np.tile(expected, (2, 1)), abs=1e-12)


def test_predicted_tucks_the_legs_where_the_torso_falls_back_and_stretches_them_where_forward():
    params = {
        "tilt_cost": [0.0, 0.3],
        "free_tilt": [0.0, 0.0, 0.0],
        "height_range": [-0.05, 0.2],
        "stop_acceleration": 100.0,
    }
    for way in (1.0, -1.0):
        bench, planned = predicting(**params)
        moved = pushed(bench, [0.4 * way, 0.0, 0.0], [0.0, 0.05 * way, 0.0]) - planned
        assert (moved[:, 2] * way < -1e-3).all()
    height = -float(standing_feet(ROBOT)[:, 2].mean())
    bench, planned = predicting(**params)
    moved = pushed(bench, [-3.0, 0.0, 0.0], [0.0, -0.5, 0.0]) - planned
    stroke = (GRAVITY * 0.2) ** 2 / (2.0 * 100.0 * GRAVITY)  # from rest 0.2 s before touchdown
    assert moved[:, 2] == pytest.approx([0.2 * height - stroke] * 2, abs=1e-6)


def test_predicted_stretches_the_legs_so_far_that_they_touch_down_early_by_a_share_of_the_flight():
    params = {"tilt_cost": [0.0, 3.0], "free_tilt": [0.0, 0.0, 0.0], "height_range": [-0.5, 0.2]}
    speed = GRAVITY * 0.2 + 0.5  # at touchdown, of a body that falls at 0.5 m/s 0.2 s before it
    for early in (0.0, 0.02, 0.05):
        bench, planned = predicting(**params, early=early)
        bench.set("terms", com_velocity=[0.0, 0.0, -0.5])
        moved = pushed(bench, [3.0, 0.0, 0.0], [0.0, 0.5, 0.0]) - planned
        assert moved[:, 2] == pytest.approx([-early * 0.2 * speed] * 2, abs=1e-5)
    bench, planned = predicting(**{**params, "height_range": [-0.01, 0.2]}, early=0.05)
    moved = pushed(bench, [3.0, 0.0, 0.0], [0.0, 0.5, 0.0]) - planned
    height = -float(standing_feet(ROBOT)[:, 2].mean())
    assert moved[:, 2] == pytest.approx([-0.01 * height] * 2, abs=1e-5)


def test_predicted_reaches_the_touchdown_of_tucked_legs_after_that_of_the_planned_ones():
    """The feet come upwards at the last, at ``retraction``, also where shorter legs land late."""
    params = {"tilt_cost": [0.0, 0.3], "free_tilt": [0.0, 0.0, 0.0], "stop_acceleration": 100.0}
    bench, planned = predicting(**params, retraction=0.5)
    bench.set("terms", com_velocity=[0.0, 0.0, -1.5])
    tucked = pushed(bench, [-3.0, 0.0, 0.0], [0.0, -0.5, 0.0])
    up = float((tucked - planned)[0, 2])
    assert up > 0.03
    # When the planned legs would touch down it is 1.5 + 0.2 g fast: so much later do the shorter ones.
    fast = 1.5 + 0.2 * GRAVITY
    later = (math.sqrt(fast**2 + 2.0 * GRAVITY * up) - fast) / GRAVITY
    fall = -fast - later * GRAVITY
    bench.set("terms", com_velocity=[0.0, 0.0, fall])
    rising = [float(fly(bench, now, 0.0).velocity[0, 2]) - fall for now in (0.2, 0.2 + later)]
    assert rising[1] == pytest.approx(0.5, abs=1e-3)
    assert rising[0] < 0.4


def test_predicted_is_mirror_symmetric():
    bench, planned = predicting()
    left = pushed(bench, [0.1, 0.4, 0.0], [-0.05, 0.02, 0.0], (-0.1, 0.05, 0.0)) - planned
    bench, _ = predicting()
    right = pushed(bench, [0.1, -0.4, 0.0], [0.05, 0.02, 0.0], (0.1, 0.05, 0.0)) - planned
    assert left == pytest.approx(right[::-1] * [1.0, -1.0, 1.0], abs=1e-6)


def test_predicted_chooses_no_more_just_before_touchdown():
    bench, _planned = predicting()
    before = pushed(bench, [0.4, 0.0, 0.0], [0.0, 0.05, 0.0])
    bench.set("terms", linear_momentum=[-0.4, 0.0, 0.0])
    assert fly(bench, 0.28, 0.01).landing == pytest.approx(before, abs=1e-12)


def ahead(off, speed, **params):
    """By how much the feet are moved of a robot that is too far ahead and too fast, 0.2 s before touchdown."""
    bench, planned = predicting(tilt_cost=[0.0, 0.0], **params)
    fly(bench, 0.0, 0.2)  # notes the place of the plan in the world
    moved = {name: value + np.array([off, 0.0, 0.0]) for name, value in places().items()}
    bench.set("terms", **moved, com_velocity=[speed, 0.0, 0.0])
    return (pushed(bench, [MASS * speed, 0.0, 0.0], np.zeros(3)) - planned)[:, 0]


def test_predicted_feet_make_good_for_a_small_miss_of_their_place():
    capture = 0.75 * 0.04 / math.sqrt(GRAVITY / -float(standing_feet(ROBOT)[:, 2].mean()))
    off, speed, miss = 0.01, 0.04, 0.01 + 0.2 * 0.04
    assert ahead(off, speed) == pytest.approx([capture] * 2, abs=1e-9)
    corrected = ahead(off, speed, place_gain=0.5, place_range=1e3)
    assert corrected == pytest.approx([capture - 0.5 * (capture + miss)] * 2, abs=1e-9)


def test_predicted_feet_of_a_robot_that_would_fall_do_not_go_to_their_planned_place():
    assert ahead(0.1, 0.6, place_gain=1.0) == pytest.approx(ahead(0.1, 0.6), abs=2e-3)


def test_the_wished_place_stays_when_the_plan_names_the_next_jump():
    """From the middle of a flight on the reference names the next lift-off and touchdown."""
    bench, _ = predicting(place_gain=1.0)
    bench.set("reference", lift_off_time=1.0, touchdown_time=1.3, com_velocity=[0.1, 0.0, 0.0])
    bench.set("phase", phase=Phase.THRUST)
    bench.step()
    bench.set("reference", time=1.1)
    bench.set("phase", phase=Phase.FLIGHT)
    wished = fly(bench, 0.1, 0.2).landing.copy()
    bench.set("reference", lift_off_time=2.0, touchdown_time=2.3)
    assert fly(bench, 0.1, 0.2).landing == pytest.approx(wished, abs=1e-12)


def test_predicted_feet_are_ahead_of_their_planned_way():
    ends = []
    for lead in (0.0, 0.012):
        bench, _ = predicting(lead_time=lead, tilt_cost=[0.0, 0.0], retraction=0.0)
        speed = [0.7, 0.0, -1.0]
        bench.set("reference", foot_velocity=[[1.2, 0.1, -0.5]] * 2, com_velocity=speed)
        bench.set("terms", com_velocity=speed, linear_momentum=MASS * np.array(speed))
        begin = fly(bench, 0.0, 0.3).position.copy()
        ends.append(fly(bench, 0.25, 0.05).position - begin)
    moved = ends[1] - ends[0]
    assert moved == pytest.approx(np.tile([0.5 * 0.012, 0.1 * 0.012, 0.0], (2, 1)), abs=1e-9)


def test_a_late_touchdown_keeps_the_lead_of_the_last_instant():
    bench, _ = predicting(lead_time=0.012, tilt_cost=[0.0, 0.0], retraction=0.0)
    bench.set("reference", foot_velocity=[[0.5, 0.0, 0.0]] * 2)
    before = fly(bench, 0.299, 0.001).position.copy()
    bench.set("reference", phase=Phase.LANDING, foot_velocity=np.zeros((2, 3)))
    late = fly(bench, 0.301, 0.0)
    assert late.position == pytest.approx(before, abs=1e-9)
    assert late.velocity == pytest.approx(np.zeros((2, 3)), abs=1e-9)


def test_feet_are_ahead_by_how_much_sooner_than_planned_the_soles_come_down():
    def end(planned, drop, **more):
        bench, _ = predicting(tilt_cost=[0.0, 0.0], retraction=0.0, **more)
        speed = [0.7, 0.0, -1.0]
        bench.set("reference", foot_velocity=[[1.2, 0.1, -1.0]] * 2, com_velocity=speed)
        bench.set("reference", lift_off_time=0.0, touchdown_time=0.4 + planned, time=0.35)
        bench.set("terms", com_velocity=speed, linear_momentum=MASS * np.array(speed))
        points = places()["contact_position"].copy()
        points[:, 2] = places()["foot_position"][:, 2].min() - drop
        bench.set("terms", contact_position=points)
        begin = fly(bench, 0.0, 0.3).position.copy()
        return fly(bench, 0.25, 0.05).position - begin

    by_time = end(0.0, 0.0)
    assert end(0.012, 0.005) == pytest.approx(by_time, abs=1e-9), "only where it is asked for"
    on_time = end(0.0, 0.0, lead_by="fall")
    swing = np.tile([0.5, 0.1, 0.0], (2, 1))
    assert on_time == pytest.approx(by_time, abs=1e-9)
    late_plan = end(0.012, 0.0, lead_by="fall") - on_time
    assert late_plan == pytest.approx(0.012 * swing, abs=1e-6)
    fall_speed = 1.0 + GRAVITY * 0.05
    toes_up = end(0.0, 0.005, lead_by="fall") - on_time
    assert toes_up == pytest.approx(0.005 / fall_speed * swing, abs=1e-6)
    most = end(0.2, 0.0, lead_by="fall") - on_time
    assert most == pytest.approx(0.03 * swing, abs=1e-6)
