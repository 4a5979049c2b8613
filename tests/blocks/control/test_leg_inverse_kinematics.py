"""The block: exact where reachable, within limits and finite always, velocity the derivative."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from aloft.blocks.control.leg_inverse_kinematics import (
    LOOKAHEAD,
    LegInverseKinematics,
    LegMemory,
    excess_pitch,
    keeps_acceleration,
)
from aloft.blocks.signals import JumpReference, Phase
from aloft.robots import five_joint_leg
from aloft.robots.description import find_robot
from aloft.robots.kinematics import ball_feet
from aloft.robots.limb import read_limb, set_limb_pose
from aloft.runtime.language.context import Clock, Context
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

from ...kernel_samples import records
from ...robots.limbed_robots import humanoid, quadruped

ROBOT = find_robot("bruce")
LEGS = [five_joint_leg.read_leg(ROBOT, foot) for foot in range(2)]
any_number = st.floats(allow_nan=False, allow_infinity=False)


def feet_of(joints):
    positions, rotations = np.empty((2, 3)), np.empty((2, 3, 3))
    for leg, position, rotation in zip(LEGS, positions, rotations, strict=True):
        angles = joints[list(leg.joints)]
        five_joint_leg.forward(leg, angles, position, rotation)
    return positions, rotations


def swing(time):
    """A smooth motion of all joints, well inside their limits, and its rate."""
    middle = ROBOT.standing_position
    size = np.tile([0.3, 0.3, 0.2, 0.3, 0.3], 2)
    shift = np.arange(10)
    return middle + size * np.sin(9.0 * time + shift), size * 9.0 * np.cos(9.0 * time + shift)


def test_standing_feet_give_the_standing_joints():
    bench = BlockBench(LegInverseKinematics, robot="bruce")
    position, rotation = feet_of(ROBOT.standing_position)
    bench.set("feet", position=position, rotation=rotation)
    bench.step()
    target = bench.get("target")
    assert np.abs(target.position - ROBOT.standing_position).max() < 1e-12
    assert np.abs(target.velocity).max() == 0.0
    assert target.reachable.all()


def test_a_moving_foot_gives_the_joints_and_rates_that_move_it():
    rate = 5000.0
    bench = BlockBench(LegInverseKinematics, robot="bruce", rate=rate)
    for tick in range(800):
        joints, speeds = swing(tick / rate)
        position, rotation = feet_of(joints)
        after, _ = feet_of(joints + 1e-6 * speeds)
        before, _ = feet_of(joints - 1e-6 * speeds)
        bench.set("feet", position=position, rotation=rotation, velocity=(after - before) / 2e-6)
        bench.step()
        target = bench.get("target")
        assert target.reachable.all()
        assert np.abs(target.position - joints).max() < 1e-9
        if tick:
            assert np.abs(target.velocity - speeds).max() < 0.02 * 2.7  # of the largest rate


@given(
    arrays(np.float64, (2, 3), elements=any_number),
    arrays(np.float64, (2, 3), elements=any_number),
    arrays(np.float64, (2, 3, 3), elements=any_number),
    arrays(np.float64, 10, elements=st.floats(-10.0, 10.0)),
)
def test_anything_finite_gives_finite_targets_within_limits(position, velocity, rotation, joints):
    bench = BlockBench(LegInverseKinematics, robot="bruce")
    bench.set("feet", position=position, velocity=velocity, rotation=rotation)
    bench.set("joints", position=joints)
    for _ in range(2):
        bench.step()
    target = bench.get("target")
    limits = ROBOT.joint_limits
    assert (target.position >= limits[:, 0] + 0.049).all()
    assert (target.position <= limits[:, 1] - 0.049).all()
    assert (np.abs(target.velocity) <= 30.0).all()


def test_a_stretched_leg_is_not_reachable_and_its_knee_does_not_move():
    bench = BlockBench(LegInverseKinematics, robot="bruce")
    position, rotation = feet_of(ROBOT.standing_position)
    position[0, 2] -= 0.2
    bench.set("feet", position=position, rotation=rotation, velocity=[[0, 0, -1.0], [0, 0, 0]])
    bench.step()
    target = bench.get("target")
    assert target.reachable.tolist() == [False, True]
    assert target.position[3] == pytest.approx(ROBOT.joint_limits[3, 1] - 0.05)
    assert target.velocity[3] == pytest.approx(0.0, abs=1e-3)


def tilted(angle, axis):
    """The axes of a level sole, seen from a base that has turned by ``angle``."""
    cosine, sine = math.cos(angle), math.sin(angle)
    if axis == "roll":
        return np.array([[1.0, 0, 0], [0, cosine, sine], [0, -sine, cosine]])
    return np.array([[cosine, 0, -sine], [0, 1.0, 0], [sine, 0, cosine]])


@pytest.mark.parametrize(
    ("turn", "away"),
    [(tilted(-0.6, "roll"), [0.0, 0.12, 0.0]), (tilted(-0.6, "pitch"), [-0.12, 0.0, 0.0])],
)
def test_beyond_reach_the_foot_slides_in_the_plane_of_its_sole(turn, away):
    """The torso has tilted, so the hip's limit keeps the leg from going as far as it should."""
    hip = LEGS[0].hip
    soles = {}
    for beyond in ("slide", "turn"):
        bench = BlockBench(LegInverseKinematics, {"beyond": beyond}, robot="bruce")
        wanted = np.array([0.0, 0.0, -0.30]) + away
        position = np.tile(hip + turn @ wanted, (2, 1))
        bench.set("feet", position=position, rotation=np.tile(turn, (2, 1, 1)), velocity=0.0)
        bench.set("joints", position=ROBOT.standing_position)
        bench.step()
        assert not bench.get("target").reachable[0]
        place, rotation = (x[0] for x in feet_of(bench.get("target").position))
        soles[beyond] = turn.T @ (place - hip), turn.T @ rotation[:, 0]
    (place, line), (turned_place, turned_line) = soles["slide"], soles["turn"]
    assert place[2] == pytest.approx(wanted[2], abs=1e-9)
    assert line == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    side = np.abs(away).argmax()
    assert 0.0 < place[side] / wanted[side] < 1.0
    assert abs(turned_place[2] - wanted[2]) > 1e-3 or abs(turned_line[2]) > 1e-2


def test_sliding_is_continuous_where_reach_ends():
    """From within reach to beyond it the joints do not jump."""
    turn = tilted(-0.6, "roll")
    bench = BlockBench(LegInverseKinematics, {"beyond": "slide"}, robot="bruce")
    bench.set("joints", position=ROBOT.standing_position)
    last, reachable = None, []
    for aside in np.linspace(0.0, 0.14, 141):
        place = LEGS[0].hip + turn @ np.array([0.0, aside, -0.31])
        bench.set(
            "feet", position=np.tile(place, (2, 1)), rotation=np.tile(turn, (2, 1, 1)), velocity=0.0
        )
        bench.step()
        joints = bench.get("target").position[:5].copy()
        reachable.append(bool(bench.get("target").reachable[0]))
        if last is not None:
            assert np.abs(joints - last).max() < 0.03
        last = joints
    assert reachable[0]
    assert not reachable[-1]


def test_a_leg_that_stretches_slows_down_and_its_velocity_is_that_of_its_position():
    """Through the soft zone and beyond, at 0.3 m/s: no jump, and the rates are the derivatives."""
    bench = BlockBench(LegInverseKinematics, robot="bruce", rate=500.0)
    position, rotation = feet_of(ROBOT.standing_position)
    bench.set("feet", rotation=rotation, velocity=[[0.0, 0.0, -0.3]] * 2)
    angles, speeds = [], []
    for tick in range(100):
        lower = position - np.array([0.0, 0.0, 0.3 * tick / 500.0])
        bench.set("feet", position=lower)
        bench.step()
        angles.append(bench.get("target").position.copy())
        speeds.append(bench.get("target").velocity.copy())
    assert not bench.get("target").reachable.any()
    measured = np.diff(angles, axis=0) * 500.0
    assert np.abs(measured).max() < 12.0
    expected = 0.5 * (np.array(speeds[1:]) + np.array(speeds[:-1]))
    assert np.abs(measured - expected).max() < 0.5


def test_a_line_given_anew_is_not_a_motion():
    bench = BlockBench(LegInverseKinematics, robot="bruce")
    position, rotation = feet_of(ROBOT.standing_position)
    bench.set("feet", position=position, rotation=rotation)
    bench.step()
    slope = 0.3
    turned = np.array(
        [[math.cos(slope), 0, -math.sin(slope)], [0, 1, 0], [math.sin(slope), 0, math.cos(slope)]]
    )
    bench.set("feet", rotation=np.stack([turned, turned]))
    bench.step()
    assert np.abs(bench.get("target").velocity).max() == 0.0
    assert bench.get("target").reachable.all()


def test_the_margin_is_kept_and_the_description_is_not_changed():
    before = ROBOT.joint_limits.copy()
    BlockBench(LegInverseKinematics, {"margin": 0.1}, robot="bruce")
    assert np.array_equal(ROBOT.joint_limits, before)


def test_needs_a_robot():
    with pytest.raises(BlockError, match="it needs a robot, and the graph names none"):
        BlockBench(LegInverseKinematics, dimensions=dict(ROBOT.dimensions))


def test_the_soles_have_the_planned_pitch_where_asked_for():
    position, flat = feet_of(ROBOT.standing_position)
    found = {}
    for follow in ("feet", "pitch"):
        bench = BlockBench(LegInverseKinematics, {"follow": follow}, robot="bruce")
        bench.set("feet", position=position, rotation=flat)
        bench.set("reference", foot_pitch=[0.3, -0.1])
        bench.step()
        found[follow] = feet_of(bench.get("target").position)
    assert found["feet"][1] == pytest.approx(flat, abs=1e-9)
    places, turned = found["pitch"]
    assert places == pytest.approx(position, abs=1e-9)
    for foot, pitch in enumerate((0.3, -0.1)):
        assert turned[foot, :, 0] == pytest.approx([math.cos(pitch), 0.0, -math.sin(pitch)])


def test_the_plans_joints_are_followed_as_long_as_the_plan_flies():
    bench = BlockBench(LegInverseKinematics, {"follow": "plan"}, robot="bruce")
    planned = {"joint_position": np.linspace(-0.5, 0.5, 10), "joint_velocity": 2.0}
    bench.set("reference", phase=int(Phase.FLIGHT), **planned)
    bench.step()
    target = bench.get("target")
    assert np.array_equal(target.position, np.linspace(-0.5, 0.5, 10))
    assert (target.velocity == 2.0).all() and target.reachable.all()
    bench.set("reference", phase=int(Phase.LANDING), **planned)
    bench.step()
    assert not np.array_equal(bench.get("target").position, np.linspace(-0.5, 0.5, 10))


@pytest.mark.long
@example(np.array([0.125, 0.5, *[0.125] * 8]))
@given(arrays(np.float64, 10, elements=st.floats(0.05, 0.95)))
def test_least_squares_agree_with_the_closed_form(fraction):
    limits = ROBOT.joint_limits
    joints = limits[:, 0] + fraction * (limits[:, 1] - limits[:, 0])
    position, rotation = feet_of(joints)
    found = {}
    for method in ("auto", "least_squares"):
        params = {"method": method, "softness": 0.0, "level": 0.001}
        bench = BlockBench(LegInverseKinematics, params, robot="bruce")
        bench.set("feet", position=position, rotation=rotation)
        bench.set("joints", position=joints + 0.01)
        bench.step()
        target = bench.get("target")
        found[method] = target.position.copy(), target.reachable.copy()
    for foot, leg in enumerate(LEGS):
        if found["auto"][1][foot] and abs(joints[leg.joints[1]]) < 1.3:
            mine = list(leg.joints)
            place, turn = feet_of(found["auto"][0])
            assert np.abs(place[foot] - position[foot]).max() < 1e-9
            assert np.abs(turn[foot][:, 0] - rotation[foot][:, 0]).max() < 1e-9
            if np.abs(found["auto"][0][mine] - joints[mine]).max() > 0.5:
                continue  # a second leg with the same sole and the same line of contact
            assert np.abs(found["auto"][0][mine] - joints[mine]).max() < 1e-9
            assert found["least_squares"][1][foot]
            assert np.abs(found["least_squares"][0][mine] - joints[mine]).max() < 1e-9


def placed(robot, joints):
    """Places and rotations of all feet of any robot."""
    places, turns = [], []
    for foot in range(len(robot.feet)):
        limb, pose = read_limb(robot, foot), np.zeros((4, 3))
        angles = np.asarray(joints)[list(limb.joints)]
        set_limb_pose(limb.links, limb.tip, angles, np.zeros((len(angles), 6)), pose)
        places.append(pose[0].copy())
        turns.append(pose[1:].copy())
    for ball in ball_feet(robot):  # the lowest point of a ball, which has no orientation
        places[ball.foot] += turns[ball.foot] @ (ball.centre - robot.feet[ball.foot].sole)
        places[ball.foot][2] -= ball.radius
        turns[ball.foot] = np.eye(3)
    return np.array(places), np.array(turns)


@pytest.mark.parametrize("robot", [quadruped(), humanoid()], ids=lambda robot: robot.name)
def test_legs_of_any_kind_follow_their_feet(robot):
    rate = 500.0
    bench = BlockBench(LegInverseKinematics, robot=robot, rate=rate)
    n = len(robot.joints)
    legs = [j for foot in range(len(robot.feet)) for j in read_limb(robot, foot).joints]
    for tick in range(100):
        shift = np.arange(n)
        joints = robot.standing_position + 0.15 * np.sin(9.0 * tick / rate + shift)
        speeds = 0.15 * 9.0 * np.cos(9.0 * tick / rate + shift)
        position, rotation = placed(robot, joints)
        velocity = (placed(robot, joints + 1e-6 * speeds)[0] - position) / 1e-6
        bench.set("feet", position=position, rotation=rotation, velocity=velocity)
        bench.set("joints", position=joints + 0.02)
        bench.step()
        target = bench.get("target")
        assert target.reachable.all()
        assert np.abs(target.position - joints)[legs].max() < 1e-7
        if tick:
            assert np.abs(target.velocity - speeds)[legs].max() < 0.05


@pytest.mark.parametrize("beyond", ["turn", "slide"])
@pytest.mark.parametrize("follow", ["feet", "pitch", "plan"])
@pytest.mark.parametrize("robot", [ROBOT, quadruped(), humanoid()], ids=lambda robot: robot.name)
def test_machine_code_computes_the_bytes_of_plain_python(robot, follow, beyond):
    """Within reach and out of it, on the way there and back."""
    params = {"follow": follow, "beyond": beyond}
    benches = [
        BlockBench(LegInverseKinematics, params, robot=robot, plain=plain)
        for plain in (False, True)
    ]
    n, reached = len(robot.joints), []
    for tick in range(8):
        joints = robot.standing_position + 0.1 * np.sin(0.02 * tick + np.arange(n))
        position, rotation = placed(robot, joints)
        position[:, 2] -= 0.3 * (tick % 4 > 1)
        for bench in benches:
            bench.set("feet", position=position, rotation=rotation, velocity=0.1)
            bench.set("joints", position=joints + 0.02)
            bench.set("reference", phase=Phase.FLIGHT if tick == 5 else Phase.LANDING)
            bench.set("reference", foot_pitch=0.1, joint_position=0.2, joint_velocity=1.0)
            bench.step()
        machine, plain = (bench.get("target") for bench in benches)
        for name in ("position", "velocity", "reachable"):
            np.testing.assert_array_equal(getattr(machine, name), getattr(plain, name))
        reached.append(bool(machine.reachable.all()))
    assert not all(reached) and (follow == "pitch" or any(reached))


def test_joints_of_no_leg_keep_their_held_or_their_measured_position():
    robot = humanoid()
    bench = BlockBench(LegInverseKinematics, robot=robot)
    position, rotation = placed(robot, robot.standing_position)
    bench.set("feet", position=position, rotation=rotation)
    bench.set("joints", position=np.full(len(robot.joints), 0.3))
    bench.step()
    names = [joint.name for joint in robot.joints]
    target = bench.get("target")
    assert target.position[names.index("waist")] == 0.1
    assert target.position[names.index("shoulder")] == 0.3
    assert target.velocity[-2:].tolist() == [0.0, 0.0]


def test_a_point_foot_out_of_reach_keeps_its_height_where_it_slides():
    robot = quadruped()
    position, _ = placed(robot, robot.standing_position)
    level = np.tile(np.eye(3), (4, 1, 1))
    away = position + np.array([0.5, 0.0, 0.0])
    heights = {}
    for beyond in ("slide", "turn"):
        bench = BlockBench(LegInverseKinematics, {"beyond": beyond}, robot=robot)
        bench.set("feet", position=away, rotation=level)
        bench.set("joints", position=robot.standing_position)
        for _ in range(5):
            bench.step()
        target = bench.get("target")
        assert not target.reachable.any()
        heights[beyond] = placed(robot, target.position)[0][:, 2] - position[:, 2]
    assert np.abs(heights["slide"]).max() < 0.3 * np.abs(heights["turn"]).max()


@given(
    arrays(np.float64, (2, 3), elements=any_number),
    arrays(np.float64, (2, 3), elements=any_number),
    arrays(np.float64, (2, 3, 3), elements=any_number),
    arrays(np.float64, 14, elements=st.floats(-10.0, 10.0)),
)
@settings(deadline=None, max_examples=30)
def test_any_leg_gives_finite_targets_within_limits(position, velocity, rotation, joints):
    robot = humanoid()
    bench = BlockBench(LegInverseKinematics, robot=robot)
    bench.set("feet", position=position, velocity=velocity, rotation=rotation)
    bench.set("joints", position=joints)
    for _ in range(2):
        bench.step()
    target = bench.get("target")
    legs, limits = slice(0, 12), robot.joint_limits
    assert (target.position[legs] >= limits[legs, 0] + 0.049).all()
    assert (target.position[legs] <= limits[legs, 1] - 0.049).all()
    assert (np.abs(target.velocity) <= 30.0).all()


def test_a_joint_that_carries_two_feet_must_be_held():
    robot = humanoid()
    moved = tuple(
        joint.model_copy(update={"parent": "waist_link"}) if "hip_pitch" in joint.name else joint
        for joint in robot.joints
    )
    params = LegInverseKinematics.Params()
    both = robot.model_copy(update={"joints": moved, "held": {}})
    unmet = list(LegInverseKinematics.requires(params, Context("block", Clock(0.002), robot=both)))
    assert len(unmet) == 1
    assert unmet[0].message == (
        "joint waist of humanoid carries 2 feet; the inverse kinematics solves every leg by "
        "itself, so it can only hold such a joint"
    )
    assert unmet[0].fix == "in the robot's description: held: {waist: 0.0}"
    assert not list(
        LegInverseKinematics.requires(
            params,
            Context("block", Clock(0.002), robot=both.model_copy(update={"held": {"waist": 0.1}})),
        )
    )


def test_where_the_toes_land_first_no_sole_is_laid_flat_to_keep_its_height():
    found = []
    for beyond, toes_first in (("slide", True), ("turn", False), ("slide", False)):
        bench = BlockBench(LegInverseKinematics, {"beyond": beyond}, robot="bruce")
        turn = np.array([[0.825, 0.0, 0.565], [0.0, 1.0, 0.0], [-0.565, 0.0, 0.825]])
        position = np.tile(LEGS[0].hip + turn @ np.array([-0.12, 0.0, -0.30]), (2, 1))
        bench.set("feet", position=position, rotation=np.tile(turn, (2, 1, 1)), velocity=0.0)
        bench.set("reference", toes_first=toes_first)
        bench.step()
        found.append(bench.get("target").position.tolist())
    assert found[0] == found[1] != found[2]


# Following the plan's joints


def in_flight(params, **reference):
    """The targets of a plan that is followed; the base has turned by 0.1 rad more about y."""
    bench = BlockBench(LegInverseKinematics, {"follow": "plan", **params}, robot="bruce")
    c, s = math.cos(0.1), math.sin(0.1)
    bench.set("feet", rotation=[[[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]] * 2)
    bench.set(
        "reference", phase=int(Phase.FLIGHT), lift_off_time=1.0, touchdown_time=1.4,
        orientation=[0.0, 0.0, 0.0, 1.0], joint_velocity=2.0, joint_acceleration=-50.0,
        **{"joint_position": -0.3, **reference},
    )  # fmt: skip
    bench.step()
    return bench.get("target")


@pytest.mark.parametrize(
    ("time", "ahead"), [(1.0, 0.0), (1.1, 0.005), (1.2, 0.01), (1.39, 0.01), (0.9, 0.01)]
)
def test_the_joints_are_ahead_of_the_plan_by_the_lead_from_mid_flight_on(time, ahead):
    target = in_flight({"plan_lead": 0.01}, time=time)
    assert target.position == pytest.approx(-0.3 + 2.0 * ahead - 25.0 * ahead**2)
    assert target.velocity == pytest.approx(2.0 - 50.0 * ahead)


def test_soles_become_level_by_the_ankles_before_touchdown():
    names = [joint.name for joint in ROBOT.joints]
    ankles = [names.index("right_ankle"), names.index("left_ankle")]
    early, late = (in_flight({"level_time": 0.08}, time=time) for time in (1.31, 1.37))
    assert early.position == pytest.approx(-0.3)
    others = np.delete(late.position, ankles)
    assert others == pytest.approx(-0.3)
    flat = np.array([0.0, 0.5, 0.0, -1.0, 0.5] * 2)
    level = in_flight({"level_time": 0.08}, time=1.37, joint_position=flat)
    (_, before), (_, after) = feet_of(flat), feet_of(level.position)
    for foot in range(2):
        pitch = [math.atan2(-turn[foot, 2, 0], turn[foot, 0, 0]) for turn in (before, after)]
        assert pitch[1] - pitch[0] == pytest.approx(-0.1, abs=1e-9)


@pytest.mark.parametrize("late_time", [0.0, 0.005])
def test_legs_that_land_late_go_on_as_in_the_flight(late_time):
    bench = BlockBench(
        LegInverseKinematics, {"follow": "plan", "late_time": late_time}, robot="bruce"
    )
    bench.set("feet", rotation=[np.eye(3)] * 2)
    found = []
    for tick, (phase, acceleration) in enumerate(
        [(Phase.FLIGHT, -50.0), (Phase.FLIGHT, 700.0), *[(Phase.LANDING, 700.0)] * 3]
    ):
        bench.set(
            "reference", phase=int(phase), lift_off_time=1.0, touchdown_time=1.398,
            time=1.391 + 0.002 * tick + 0.002 * (tick > 0), orientation=[0.0, 0.0, 0.0, 1.0],
            joint_position=-0.3, joint_velocity=2.0, joint_acceleration=acceleration,
        )  # fmt: skip
        bench.step()
        found.append(bench.get("target").velocity.copy())
    goes_on = [2.0 - 50.0 * since for since in (0.002, 0.004)]
    law = found[4][0]
    assert law != pytest.approx(2.0, abs=0.3)
    expected = [2.0, 2.0, *(goes_on if late_time else [law, law]), law]
    assert [velocity[0] for velocity in found] == pytest.approx(expected)


def test_the_lead_reads_no_acceleration_of_the_landing():
    for late_time, expected in ((0.0, 700.0), (0.005, -50.0)):
        bench = BlockBench(
            LegInverseKinematics,
            {"follow": "plan", "late_time": late_time, "plan_lead": 0.01},
            robot="bruce",
        )
        bench.set("feet", rotation=[np.eye(3)] * 2)
        for time, acceleration in ((1.39, -50.0), (1.396, 700.0)):
            bench.set(
                "reference", phase=int(Phase.FLIGHT), lift_off_time=1.0, touchdown_time=1.398,
                time=time, orientation=[0.0, 0.0, 0.0, 1.0], joint_position=-0.3,
                joint_velocity=2.0, joint_acceleration=acceleration,
            )  # fmt: skip
            bench.step()
        assert bench.get("target").velocity == pytest.approx(2.0 + 0.01 * expected)


def signal(kind, **values):
    """A signal with the values named."""
    made = kind.allocate(ROBOT.dimensions)
    for name, value in values.items():
        getattr(made, name)[...] = value
    return made


@pytest.mark.parametrize("pitch", [-2.9, -0.5, 0.0, 1.0, 3.0])
@pytest.mark.parametrize("more", [-0.3, 0.0, 0.2])
def test_how_far_the_base_has_turned_beyond_the_plan(pitch, more):
    c, s = math.cos(pitch + more), math.sin(pitch + more)
    level = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    assert excess_pitch(level, pitch) == pytest.approx(more, abs=1e-12)


@pytest.mark.parametrize(
    ("touchdown", "known", "late", "keeps"),
    [
        (1.0, True, 0.01, True), (1.0, False, 0.01, False), (1.0, True, 0.0, False),
        (1.0 + 0.9 * LOOKAHEAD, True, 0.01, True), (1.0 + 1.1 * LOOKAHEAD, True, 0.01, False),
        (1.0 - 0.9 * LOOKAHEAD, True, 0.01, True), (1.0 - 1.1 * LOOKAHEAD, True, 0.01, False),
    ],
)  # fmt: skip
def test_accelerations_near_the_touchdown_are_those_of_before(touchdown, known, late, keeps):
    (params,) = records({"late_time": late})
    memory = signal(LegMemory, flew=known)
    reference = signal(JumpReference, time=1.0, touchdown_time=touchdown)
    assert keeps_acceleration(reference, params, memory) == keeps
