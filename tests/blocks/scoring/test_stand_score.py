"""A stance, a squat and a push are judged: a good one passes, and each criterion can fail alone."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from aloft.blocks.scoring.footing import Footing, add_roll, measure_feet
from aloft.blocks.scoring.stand_score import StandScore
from aloft.robots.description import find_robot
from aloft.robots.kinematics import standing_heights
from aloft.runtime.testing import BlockBench

from ...robots.limbed_robots import humanoid, quadruped

ROBOTS = {"bruce": find_robot("bruce"), "quadruped": quadruped(), "humanoid": humanoid()}
PERIOD = 0.01


def standing(robot):
    """The truth of a robot that stands still, every contact point equally loaded."""
    n, places = len(robot.contacts), {}
    for k, foot in enumerate(robot.feet):
        places[foot.name] = np.array([0.2 * (1 if k < 2 else -1), 0.1 * (-1) ** k, 0.0])
    points = np.array([
        places[c.foot] + np.array([c.position[0], c.position[1], 0.0]) for c in robot.contacts
    ])  # fmt: skip
    middle = points.mean(axis=0)
    weight = Footing(robot).weight
    return {
        "base_position": [0.0, 0.0, 0.3], "base_orientation": [0.0, 0.0, 0.0, 1.0],
        "com": [middle[0], middle[1], 0.3], "contact_position": points,
        "contact_force": np.tile([0.0, 0.0, weight / n], (n, 1)),
        "contact_touched": np.ones(n, bool), "motor_torque": np.full(len(robot.joints), -2.0),
    }  # fmt: skip


def run(robot, change=lambda time, truth: None, plan=None, **params):
    wired = ("truth", "wbc", "reference") if plan else ("truth", "wbc")
    params = {"judge_time": 1.0, **params}
    bench = BlockBench(StandScore, params, robot=robot, rate=1 / PERIOD, wired=wired)
    while bench.stop_reason is None and bench.clock.tick < 200:
        time, truth = bench.clock.tick * PERIOD, standing(robot)
        change(time, truth)
        bench.set("truth", **truth)
        if plan:
            bench.set("reference", com=[0.0, 0.0, plan(time)])
        bench.step()
    return bench.block.metrics(), bench.stop_reason


def squat(time):
    return 0.3 - 0.05 * max(0.0, 1.0 - abs(time - 0.5) / 0.2)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_that_stands_still_succeeds(name):
    metrics, reason = run(ROBOTS[name])
    assert metrics["success"] is True and metrics["reason"] == "all criteria hold"
    assert reason == "judged at 1.00 s"
    assert metrics["final_load_share"] == pytest.approx(1.0 / len(ROBOTS[name].feet))
    assert metrics["final_support_margin_m"] > 0.02
    assert metrics["peak_motor_torque_nm"] == 2.0


def test_a_squat_must_be_as_deep_as_asked_for_or_planned():
    def down(time, truth):
        truth["com"][2] = squat(time)

    assert run(ROBOTS["quadruped"], down, squat_depth=0.05)[0]["success"]
    assert run(ROBOTS["quadruped"], down, squat)[0]["success"]
    metrics, _ = run(ROBOTS["quadruped"], down, squat_depth=0.08)
    assert metrics["reason"] == "squatted by 50.0 mm, not within 10% of 80.0 mm"
    assert run(ROBOTS["quadruped"], plan=squat)[0]["reason"].startswith("squatted by 0.0 mm")
    assert run(ROBOTS["quadruped"], plan=lambda time: 0.3)[0]["success"]


def lift(time, truth):
    if 0.5 <= time < 0.6:
        truth["contact_touched"][0] = False


def at(begin, **fields):
    def change(time, truth):
        if time >= begin:
            for name, value in fields.items():
                truth[name] = value(truth[name]) if callable(value) else value

    return change


def moved(points):
    points = points.copy()
    points[:, 0] += 0.01
    return points


TILTED = [math.sin(0.15), 0.0, 0.0, math.cos(0.15)]
FAILURES = {
    "knee": (at(0.4, forbidden_contacts=2), r"^something other than the contact points touched"),
    "limit": (at(0.4, joint_limit_violation=0.01), r"^a joint went 0.0100 rad over its limit"),
    "motor": (at(0.4, motor_overload=0.5), r"^a motor gave 0.5 N m more than its speed allows"),
    "tilt": (
        lambda time, truth: truth.update(base_orientation=TILTED) if 0.4 < time < 0.5 else None,
        r"^tilted by 17.2 deg while it should stand, limit 15 deg",
    ),
    "leaning": (
        at(0.4, base_orientation=[math.sin(0.05), 0.0, 0.0, math.cos(0.05)]),
        r"^tilt at rest 5.73 deg, limit 5.0 deg",
    ),
    "moving": (at(0.4, com_velocity=[0.1, 0.0, 0.0]), r"^centre of mass at rest moves at 0.100"),
    "turning": (at(0.4, base_angular_velocity=[0, 0, 0.3]), r"^base at rest turns at 0.300 rad/s"),
    "stepping": (lift, r"^stepped: a foot was off the ground for 0.1.0 s while it should stand"),
    "sliding": (at(0.5, contact_position=moved), r"^feet slid 10.0 mm while it should stand"),
    "lopsided": (
        at(0.5, contact_force=lambda f: f * np.array([0.2, 1.2, 1.3, 1.3])[:, None]),
        r"^a foot carries 5% of the weight at rest, limit 10%",
    ),
    "edge": (
        at(0.5, com=lambda com: [com[0] + 0.25, com[1], com[2]]),
        r"^centre of mass .* mm inside the support at rest, limit 10 mm",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAILURES)
def test_each_criterion_can_fail_alone(name):
    change, expected = FAILURES[name]
    metrics, _ = run(ROBOTS["quadruped"], change)
    assert metrics["success"] is False
    assert re.search(expected, metrics["reason"]), metrics["reason"]


def test_a_fall_ends_the_run_and_is_a_share_of_the_standing_height():
    robot = ROBOTS["quadruped"]
    limit = Footing(robot).fall_height
    assert limit == pytest.approx(-0.315 * standing_heights(robot).min(), abs=1e-3)
    metrics, reason = run(robot, at(0.5, base_position=[0.0, 0.0, limit - 0.001]))
    assert reason == "the robot fell"
    assert metrics["reason"].startswith("fell at 0.500 s")
    assert run(robot, at(0.5, base_position=[0.0, 0.0, limit + 0.001]))[0]["success"]


def test_a_flat_foot_needs_three_loaded_points():
    def unload(points):
        def change(time, truth):
            truth["contact_touched"][points] = False

        return change

    assert run(ROBOTS["humanoid"], unload([0]))[0]["success"]
    metrics, _ = run(ROBOTS["humanoid"], unload([0, 1]))
    assert metrics["reason"] == "1 contact points carry no load at rest: a sole is not flat"


def test_point_feet_turn_as_their_pattern_does():
    robot = ROBOTS["quadruped"]
    footing, truth = Footing(robot), standing(robot)
    middle, before, after = np.zeros((4, 2)), np.zeros((4, 2)), np.zeros((4, 2))
    upright = np.array([0.0, 0.0, 0.0, 1.0])
    feet = footing.foot_of_point
    measure_feet(feet, truth["contact_position"], upright, middle, before)
    turn = np.array([[math.cos(0.3), -math.sin(0.3)], [math.sin(0.3), math.cos(0.3)]])
    points = truth["contact_position"].copy()
    points[:, :2] = points[:, :2] @ turn.T + [1.0, 2.0]
    measure_feet(feet, points, upright, middle, after)
    assert after == pytest.approx(before @ turn.T, abs=1e-12)


def test_a_ball_that_rolls_does_not_slide():
    """A ball rolls as its foot turns over, and not as it turns on the spot."""
    robot = ROBOTS["quadruped"]
    balls, standing = Footing(robot).ball_feet(), robot.standing_position
    radius = robot.contacts[0].radius

    def rolled(axis: int, angle: float):
        """The way of the feet while the whole robot turns about an axis of the world."""
        turned, way = np.zeros((4, 3, 3)), np.zeros((4, 2))
        for part in np.linspace(0.0, angle, 21):
            orientation = np.array([0.0, 0.0, 0.0, math.cos(0.5 * part)])
            orientation[axis] = math.sin(0.5 * part)
            add_roll(balls, standing, orientation, turned, way)
        return way

    assert rolled(0, 0.5) == pytest.approx(np.tile([0.0, -0.5 * radius], (4, 1)), abs=1e-5)
    assert rolled(1, 0.5) == pytest.approx(np.tile([0.5 * radius, 0.0], (4, 1)), abs=1e-5)
    assert rolled(2, 0.5) == pytest.approx(np.zeros((4, 2)), abs=1e-9)
