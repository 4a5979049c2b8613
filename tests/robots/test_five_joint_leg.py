"""The closed-form leg: inverse undoes forward, rates are derivatives, limits hold, no surprise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from aloft.mathematics import rotations
from aloft.robots import five_joint_leg as legs
from aloft.robots.description import find_robot
from aloft.robots.five_joint_leg import inverse_velocity
from aloft.robots.kinematics import link_poses

from ..turns import quaternion_of

ROBOT = find_robot("bruce")
LEGS = [legs.read_leg(ROBOT, foot) for foot in range(len(ROBOT.feet))]
unit = st.floats(0.0, 1.0)
fractions = arrays(np.float64, 5, elements=unit)
sides = st.sampled_from([0, 1])
any_number = st.floats(allow_nan=False, allow_infinity=False)


def forward(leg, angles):
    position, rotation = np.empty(3), np.empty((3, 3))
    legs.forward(leg, np.asarray(angles), position, rotation)
    return position, rotation


def inverse(leg, sole, line, kept_yaw=0.0, softness=0.0, level=legs.LEVEL):
    out = np.full(5, np.nan)
    inside, _ = legs.inverse(
        leg, np.asarray(sole), np.asarray(line),
        softness, kept_yaw, level, out,
    )  # fmt: skip
    return out, inside


def within(leg, fraction):
    return leg.limits[:, 0] + fraction * (leg.limits[:, 1] - leg.limits[:, 0])


@given(sides, fractions)
def test_forward_agrees_with_the_chain_of_the_description(side, fraction):
    leg = LEGS[side]
    angles = within(leg, fraction)
    joints = np.zeros((1, len(ROBOT.joints)))
    joints[0, list(leg.joints)] = angles
    poses = link_poses(ROBOT, np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]]), joints)
    foot = ROBOT.feet[side]
    origin, turn = poses.of(foot.link)
    position, rotation = forward(leg, angles)
    assert np.abs(position - (origin[0] + turn[0] @ np.array(foot.sole))).max() < 1e-14
    assert np.abs(rotation - turn[0]).max() < 1e-14


@given(sides, fractions)
def test_inverse_undoes_forward(side, fraction):
    """Not only the foot comes back but the joint angles: the answer within limits is unique."""
    leg = LEGS[side]
    angles = within(leg, 0.001 + 0.998 * fraction)
    # At a hip pitch of a right angle yaw and roll are the same turn.
    assume(abs(math.cos(angles[1])) > 0.01)
    sole, rotation = forward(leg, angles)
    # Where the foot's line points at the hip, any leg plane will do.
    lever = (sole - leg.hip) / np.linalg.norm(sole - leg.hip)
    assume(np.linalg.norm(np.cross(lever, rotation[:, 0])) > 0.05)
    # Beyond that slope the line meets the hip from the other side.
    assume(np.cross(rotation[:, 0], lever) @ rotation[:, 1] > 0.0)
    out, inside = inverse(leg, sole, 2.5 * rotation[:, 0])
    assert inside
    assert np.abs(out - angles).max() < 1e-9
    back, turn = forward(leg, out)
    assert np.abs(back - sole).max() < 1e-9
    assert np.abs(turn - rotation).max() < 1e-9


def test_inverse_in_gimbal_lock_is_still_exact():
    """With the thigh level, yaw and roll are one: keep the present yaw, still reach the foot."""
    leg = LEGS[0]
    angles = np.array([0.2, math.pi / 2, 0.1, -1.2, -0.3])
    sole, rotation = forward(leg, angles)
    out, inside = inverse(leg, sole, rotation[:, 0], kept_yaw=0.25)
    assert inside
    assert out[0] == pytest.approx(0.25, abs=1e-9)
    assert np.abs(forward(leg, out)[0] - sole).max() < 1e-9


@given(sides, st.floats(1.0, 2.2), arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)))
@example(0, 1.52, np.array([0.0, 1.0, 0.0]))
@example(1, 1.60, np.array([0.0, 1.0, 0.0]))
def test_a_thigh_that_passes_level_keeps_its_yaw(side, pitch, beside):
    """A leg drawn up passes gimbal lock twice. With a foot 5 mm beside its place the exact answer
    turns the hip by up to a right angle there and half a turn back; with a wide level it does not,
    and the foot is within 15 mm of its target."""
    leg = LEGS[side]
    sole, rotation = forward(leg, [0.0, pitch, 0.0, -1.6, 0.3])
    target = sole + 0.005 * beside
    out, inside = inverse(leg, target, rotation[:, 0], kept_yaw=0.0, level=0.3)
    assert inside
    assert abs(out[0]) < 0.15
    assert abs(out[2]) < 0.15
    assert np.abs(forward(leg, out)[0] - target).max() < 0.015


@given(
    sides,
    arrays(np.float64, 3, elements=any_number),
    arrays(np.float64, 3, elements=any_number),
    any_number,
    st.sampled_from([0.0, 0.005]),
)
def test_anything_finite_gives_finite_angles_within_limits(side, sole, line, yaw, softness):
    leg = LEGS[side]
    out, _ = inverse(leg, sole, line, yaw, softness)
    assert np.isfinite(out).all()
    assert (out >= leg.limits[:, 0]).all() and (out <= leg.limits[:, 1]).all()


@given(sides, arrays(np.float64, 3, elements=st.floats(-0.5, 0.5)))
def test_what_is_called_reachable_is_reached(side, offset):
    leg = LEGS[side]
    sole = leg.hip + offset
    out, inside = inverse(leg, sole, [1.0, 0.0, 0.0])
    reached, rotation = forward(leg, out)
    error = max(np.abs(reached - sole).max(), np.abs(rotation[:, 0] - [1.0, 0.0, 0.0]).max())
    assert not inside or error < 1e-9


def test_too_far_points_the_stretched_leg_at_the_target():
    leg = LEGS[0]
    target = leg.hip + np.array([0.1, -0.05, -0.5])
    out, inside = inverse(leg, target, [1.0, 0.0, 0.0])
    assert not inside
    assert out[3] == pytest.approx(leg.limits[3, 1])  # as straight as it may be
    reached, rotation = forward(leg, out)
    assert rotation[:, 0] == pytest.approx([1.0, 0.0, 0.0])
    lever = rotation @ np.array([leg.plane[2, 0], 0.0, leg.plane[2, 1]])
    wanted, found = target - lever - leg.hip, reached - lever - leg.hip
    assert np.linalg.norm(np.cross(found, wanted)) < 1e-9
    assert found @ wanted > 0


def test_a_soft_stretch_slows_the_knee_and_says_by_how_much():
    """The knee of a stretching leg becomes ever faster, up to where it stops at once; the soft one
    does not, and its foot moves by the share that is returned."""
    leg, step = LEGS[0], 1e-5
    distances = np.arange(0.33, 0.345, step)
    for softness, fastest in ((0.0, 1000.0), (0.005, 45.0)):
        knees, reached, shares = [], [], []
        for distance in distances:
            out = np.empty(5)
            target = (
                leg.hip + leg.plane[2, 0] * np.array([1.0, 0.0, 0.0]) + [0, 0, -distance - 0.024]
            )
            inside, share = legs.inverse(
                leg, target, np.array([1.0, 0.0, 0.0]),
                softness, 0.0, legs.LEVEL, out,
            )  # fmt: skip
            assert inside == (share == 1.0)
            knees.append(out[3])
            reached.append(-forward(leg, out)[0][2])
            shares.append(share)
        gain = np.abs(np.diff(knees)) / step
        assert gain.max() < fastest
        assert softness > 0.0 or gain.max() > 300.0
        followed = np.diff(reached) / step
        middle = 0.5 * (np.array(shares[1:]) + np.array(shares[:-1]))
        if softness:
            assert np.abs(followed - middle).max() < 0.1
            assert shares[-1] < 0.5


def test_an_ankle_at_its_limit_gives_up_the_slope_and_keeps_the_sole():
    leg = LEGS[0]
    target = leg.hip + np.array([0.05, 0.0, -0.3])
    slope = np.array([math.cos(1.2), 0.0, math.sin(1.2)])
    out, inside = inverse(leg, target, slope)
    assert not inside
    assert out[4] == leg.limits[4, 1]
    assert np.abs(forward(leg, out)[0] - target).max() < 1e-9


@given(
    sides,
    st.floats(-0.1, 0.1), st.floats(-0.08, 0.08), st.floats(-0.42, -0.1),
    st.floats(-0.9, 0.9), st.floats(-0.5, 0.5),
)  # fmt: skip
def test_small_steps_of_the_target_are_small_steps_of_the_joints(side, x, y, z, slope, heading):
    """Also across the borders of what is reachable; a square root's slope is the steepest."""
    leg = LEGS[side]
    line = np.array(
        [
            math.cos(slope) * math.cos(heading),
            math.cos(slope) * math.sin(heading),
            math.sin(slope),
        ]
    )
    sole = leg.hip + np.array([x, y, z])
    first, _ = inverse(leg, sole, line)
    second, _ = inverse(leg, sole + 1e-8, line)
    assert np.abs(second - first).max() < 1e-4


@given(sides, fractions, arrays(np.float64, 5, elements=st.floats(-1.0, 1.0)))
def test_jacobian_is_the_derivative_of_forward(side, fraction, rate):
    leg = LEGS[side]
    angles, step = within(leg, fraction), 1e-6
    out = np.empty((6, 5))
    legs.jacobian(leg.plane, leg.signs, angles, out)
    before, turn_before = forward(leg, angles - step * rate)
    after, turn_after = forward(leg, angles + step * rate)
    _, turn = forward(leg, angles)
    assert np.abs((after - before) / (2 * step) - out[:3] @ rate).max() < 1e-8
    spin = (turn_after - turn_before) / (2 * step) @ turn.T
    omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    assert np.abs(omega - out[3:] @ rate).max() < 1e-8


@given(sides, fractions, arrays(np.float64, 5, elements=st.floats(-1.0, 1.0)))
def test_inverse_velocity_undoes_the_jacobian(side, fraction, rate):
    leg = LEGS[side]
    angles = within(leg, fraction)
    assume(abs(math.cos(angles[1])) > 0.1 and angles[3] < -0.1)
    sole_jacobian, rotation = np.empty((6, 5)), forward(leg, angles)[1]
    legs.jacobian(leg.plane, leg.signs, angles, sole_jacobian)
    twist = sole_jacobian @ rate
    rows = np.vstack([sole_jacobian[:3], rotation[:, 1:].T @ sole_jacobian[3:]])
    assume(np.linalg.svd(rows)[1][-1] > 0.02)
    out = np.empty(5)
    inverse_velocity(
        sole_jacobian, rotation, twist[:3], np.cross(twist[3:], rotation[:, 0]), 0.3, 1e-5, 0.0, 0.0,
        legs.velocity_scratch(), out,
    )  # fmt: skip
    assert np.abs(out - rate).max() < 1e-5


def test_a_leg_of_another_kind_is_refused_by_name():
    axes = tuple(
        joint.model_copy(update={"axis": (0.0, 1.0, 0.0)}) if i == 2 else joint
        for i, joint in enumerate(ROBOT.joints)
    )
    with pytest.raises(ValueError, match=r"foot right_foot: joint right_hip_roll should turn .*x"):
        legs.read_leg(ROBOT.model_copy(update={"joints": axes}), 0)
    beside = tuple(foot.model_copy(update={"sole": (0.0, 0.01, -0.02)}) for foot in ROBOT.feet)
    with pytest.raises(ValueError, match="beside the leg plane"):
        legs.read_leg(ROBOT.model_copy(update={"feet": beside}), 0)


def test_a_foot_out_of_reach_stays_where_it_is_as_its_ankle_reaches_the_limit():
    """The torso leans to the left by 19.5 deg and pitches slowly; the left hip is at its limit."""
    leg = LEGS[1]._replace(limits=np.add(LEGS[1].limits, [0.15, -0.15]))
    last, most, ankles = None, 0.0, []
    for pitch in np.linspace(0.1, -0.1, 201):
        rotation = np.empty((3, 3))
        rotations.to_matrix(quaternion_of((0.0, -pitch, 0.0)), rotation)
        lean = np.empty((3, 3))
        rotations.to_matrix(quaternion_of((0.34, 0.0, 0.0)), lean)
        sole, angles = np.array([0.059 + 0.1 * pitch, 0.208, -0.266]), np.empty(5)
        found, _ = legs.slide(leg, sole, rotation @ lean, 0.0, 0.0, 0.3, np.empty(3), angles)
        assert found
        if last is not None:
            most = max(most, np.abs(angles - last).max())
        last = angles
        ankles.append(angles[4])
    assert max(ankles) == pytest.approx(leg.limits[4, 1])
    assert min(ankles) < leg.limits[4, 1] - 0.02
    assert most < 0.01
