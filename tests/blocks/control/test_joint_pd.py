"""Who commands which leg when, and that blending is the sum of both feedbacks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.blocks.control.joint_pd import (
    JointPD,
    add_friction,
    add_soft_stops,
    blend_feedback,
    integrate_accelerations,
)
from aloft.blocks.signals import CommandMode, Phase
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench

from ...kernel_samples import records

ROBOT = find_robot("bruce")
FLIGHT_KP = np.tile([40.0, 60.0, 60.0, 60.0, 15.0], 2)
FLIGHT_KD = np.tile([1.0, 1.5, 1.5, 1.2, 0.3], 2)


GAINS = {
    "flight_stiffness": {"*": 60.0, "*_hip_yaw": 40.0, "*_ankle": 15.0},
    "flight_damping": {"*": 1.5, "*_hip_yaw": 1.0, "*_knee": 1.2, "*_ankle": 0.3},
}


def make(robot=ROBOT, **params):
    bench = BlockBench(JointPD, {**GAINS, **params}, robot=robot)
    bench.set("wbc", torque=np.arange(1.0, 11.0))
    bench.set("legs", position=0.1, velocity=0.2)
    bench.set("joints", position=np.linspace(-1, 1, 10), velocity=0.5)
    return bench


def settle(bench, phase, stance):
    bench.set("phase", phase=int(phase), stance=stance)
    bench.step(10)
    return bench.get("command")


@pytest.mark.parametrize("phase", [Phase.STAND, Phase.THRUST, Phase.LANDING, Phase.RECOVER])
def test_on_the_ground_only_the_feedforward_acts(phase):
    command = settle(make(), phase, True)
    assert command.mode == CommandMode.ACTIVE
    assert np.array_equal(command.torque, np.arange(1.0, 11.0))
    assert not command.stiffness.any() and not command.damping.any()
    assert np.array_equal(command.position, np.linspace(-1, 1, 10))


def test_in_the_air_only_the_feedback_acts():
    command = settle(make(), Phase.FLIGHT, False)
    assert not command.torque.any()
    assert np.array_equal(command.stiffness, FLIGHT_KP)
    assert np.array_equal(command.damping, FLIGHT_KD)
    assert (command.position == 0.1).all() and (command.velocity == 0.2).all()


def test_planned_torques_are_fed_forward_while_plan_and_robot_fly():
    bench = make(flight_feedforward=0.5)
    bench.set("reference", phase=int(Phase.FLIGHT), joint_torque=np.arange(10.0))
    assert np.array_equal(settle(bench, Phase.FLIGHT, False).torque, 0.5 * np.arange(10.0))
    bench.set("reference", phase=int(Phase.LANDING), joint_torque=np.arange(10.0))
    assert not settle(bench, Phase.FLIGHT, False).torque.any()


def test_a_leg_that_lands_late_keeps_swinging():
    command = settle(make(), Phase.LANDING, [True, False, False, False])
    assert np.array_equal(command.torque, np.r_[np.arange(1.0, 6.0), np.zeros(5)])
    assert np.array_equal(command.stiffness, np.r_[np.zeros(5), FLIGHT_KP[5:]])


def test_a_leg_that_takes_a_step_follows_the_whole_body_controller():
    bench = make()
    bench.set("phase", stepping=[False, False, True, True])
    command = settle(bench, Phase.LANDING, [True, True, False, False])
    assert np.array_equal(command.torque, np.arange(1.0, 11.0))
    assert not command.stiffness.any()


def test_a_standing_robot_without_contact_does_not_swing_its_legs():
    command = settle(make(), Phase.STAND, False)
    assert not command.stiffness.any()
    assert command.torque.any()


def test_blend_is_linear_in_time():
    bench = make(blend=0.01)
    settle(bench, Phase.STAND, True)
    bench.set("phase", phase=int(Phase.FLIGHT), stance=False)
    for tick in range(1, 8):
        bench.step()
        weight = min(tick / 5.0, 1.0)
        assert bench.get("command").stiffness == pytest.approx(weight * FLIGHT_KP)
        assert bench.get("command").torque == pytest.approx((1 - weight) * np.arange(1.0, 11.0))


def test_no_blend_switches_at_once():
    bench = make(blend=0.0)
    bench.set("phase", phase=int(Phase.FLIGHT), stance=False)
    bench.step()
    assert np.array_equal(bench.get("command").stiffness, FLIGHT_KP)


def test_half_way_the_torque_is_the_mean_of_both_controllers():
    bench = make(blend=0.004, stance_stiffness=20.0, stance_damping=1.0)
    settle(bench, Phase.STAND, True)
    bench.set("phase", phase=int(Phase.FLIGHT), stance=False)
    bench.step()
    command = bench.get("command")
    q, rate = np.linspace(-1, 1, 10), 0.5
    torque = (
        command.torque
        + command.stiffness * (command.position - q)
        + command.damping * (command.velocity - rate)
    )
    flight = FLIGHT_KP * (0.1 - q) + FLIGHT_KD * (0.2 - rate)
    stance = np.arange(1.0, 11.0) + 1.0 * (0.0 - rate)
    assert torque == pytest.approx(0.5 * flight + 0.5 * stance)


def test_acceleration_targets_lead_the_joints_by_the_commanded_acceleration():
    """A steady acceleration a leads a joint at rest by a times leak, and leak squared."""
    bench = make(stance_targets="acceleration", leak=0.02, stance_stiffness=20.0)
    bench.set("joints", velocity=0.0)
    acceleration = np.zeros(16)
    acceleration[6 + 3] = 10.0
    bench.set("wbc", acceleration=acceleration)
    bench.set("phase", phase=int(Phase.STAND), stance=True)
    bench.step(500)
    command = bench.get("command")
    lead = command.position - np.linspace(-1, 1, 10)
    assert lead[3] == pytest.approx(10.0 * 0.02**2, rel=0.15)
    assert np.abs(np.delete(lead, 3)).max() < 1e-12


def test_the_legs_kinematics_can_be_what_the_stance_gains_act_towards():
    gains = {"stance_stiffness": 20.0, "stance_damping": 1.0}
    command = settle(make(stance_targets="legs", **gains), Phase.THRUST, True)
    assert np.array_equal(command.torque, np.arange(1.0, 11.0))
    assert (command.stiffness == 20.0).all() and (command.damping == 1.0).all()
    assert (command.position == 0.1).all() and (command.velocity == 0.2).all()


def test_friction_pushes_the_way_the_joint_moves():
    bench = make(friction=0.07)
    bench.set("wbc", torque=0.0)
    bench.set("joints", velocity=np.r_[np.full(5, 10.0), np.full(5, -10.0)])
    command = settle(bench, Phase.STAND, True)
    assert command.torque == pytest.approx(np.r_[np.full(5, 0.07), np.full(5, -0.07)])


def test_a_share_of_the_motors_own_friction_is_made_up_for():
    bench = make(friction_share=0.5)
    bench.set("wbc", torque=0.0)
    bench.set("joints", velocity=np.full(10, 10.0))
    motors = ROBOT.motors
    wanted = 0.5 * (motors.friction + 10.0 * motors.damping)
    assert wanted.any()
    assert settle(bench, Phase.STAND, True).torque == pytest.approx(wanted)


def test_a_soft_stop_pushes_back_from_a_limit_and_brakes():
    """The left knee stands 20 mrad from its upper limit and moves on at 2 rad/s."""
    knee = 3
    limit = ROBOT.joint_limits[knee, 1]
    joints, rates = ROBOT.standing_position.copy(), np.zeros(10)
    joints[knee], rates[knee] = limit - 0.02, 2.0
    torques = {}
    for gain in (0.0, 3.0):
        bench = make(stop_gain=gain, stop_margin=0.05)
        bench.set("joints", position=joints, velocity=rates)
        command = settle(bench, Phase.LANDING, True)
        torques[gain] = (
            command.torque
            + command.stiffness * (command.position - joints)
            + command.damping * (command.velocity - rates)
        )
    added = torques[3.0] - torques[0.0]
    depth = 0.03
    expected = -3.0 * FLIGHT_KP[knee] * depth - 3.0 * depth / 0.05 * FLIGHT_KD[knee] * 2.0
    assert added[knee] == pytest.approx(expected)
    assert np.delete(added, knee) == pytest.approx(0.0, abs=1e-12)


def test_without_gains_every_joint_gets_some_by_its_inertia_and_its_motor():
    bench = BlockBench(JointPD, {}, robot="bruce")
    command = settle(bench, Phase.FLIGHT, False)
    stiffness, damping = command.stiffness, command.damping
    assert stiffness[:5] == pytest.approx(stiffness[5:], rel=1e-6)  # left as right
    peak = np.abs(ROBOT.joint_to_motor).T @ ROBOT.motors.peak_torque
    assert (stiffness <= peak / 0.2 + 1e-9).all() and (stiffness > 1.0).all()
    inertia = (damping / 1.6) ** 2 / stiffness
    assert (inertia > np.diag(ROBOT.rotor_matrix)).all()  # and what the links add
    limited = np.isclose(stiffness, peak / 0.2)
    assert stiffness[~limited] == pytest.approx(3600.0 * inertia[~limited])
    assert limited.any() and not limited.all()


@pytest.mark.parametrize("planned", [False, True])
def test_held_joints_are_held_on_the_ground_and_in_the_air(planned):
    """At their angle, or where the plan has them, as a task may let them move."""
    held = ROBOT.changed(held={"left_hip_yaw": 0.3})
    if planned:
        bench, wanted = make(robot=held), (0.7, -0.2)
        bench.set("reference", joint_position=np.full(10, 0.7), joint_velocity=np.full(10, -0.2))
    else:
        wired = ["wbc", "legs", "phase", "joints"]
        bench, wanted = BlockBench(JointPD, GAINS, robot=held, wired=wired), (0.3, 0.0)
        bench.set("wbc", torque=np.arange(1.0, 11.0))
    for phase, stance in ((Phase.STAND, True), (Phase.FLIGHT, False)):
        command = settle(bench, phase, stance)
        assert command.stiffness[5] == 40.0 and command.damping[5] == 1.0
        assert (command.position[5], command.velocity[5]) == wanted
    assert settle(bench, Phase.STAND, True).torque[5] == 6.0


def test_joints_of_no_leg_follow_the_plan_while_all_legs_swing():
    """The right leg's foot is gone, so its five joints belong to no leg."""
    one_leg = ROBOT.changed(
        feet=ROBOT.feet[1:], contacts=tuple(c for c in ROBOT.contacts if c.foot == "left_foot")
    )
    assert len(one_leg.contacts) == 2
    bench = make(robot=one_leg)
    bench.set("reference", joint_position=np.full(10, 0.7), joint_velocity=np.full(10, -0.2))
    command = settle(bench, Phase.FLIGHT, False)
    assert (command.position[:5] == 0.7).all() and (command.velocity[:5] == -0.2).all()
    assert (command.position[5:] == 0.1).all()
    assert np.array_equal(command.stiffness, FLIGHT_KP)
    command = settle(bench, Phase.LANDING, True)
    assert not command.stiffness.any() and (command.torque == np.arange(1.0, 11.0)).all()
    alone = BlockBench(JointPD, GAINS, robot=one_leg, wired=["wbc", "legs", "phase", "joints"])
    command = settle(alone, Phase.FLIGHT, False)
    assert np.array_equal(command.position[:5], ROBOT.standing_position[:5])


# Feedback, friction and soft stops

RANDOM = np.random.default_rng(3)


def torque(stiffness, position, damping, velocity, at):
    return stiffness * (position - at.position) + damping * (velocity - at.velocity)


def blended(weight, flight, stance, at):
    """The command that blends two feedbacks, each a stiffness, position, damping and velocity."""
    names = ("stiffness", "position", "damping", "velocity")
    fields = {f"flight_{n}": v for n, v in zip(names, flight, strict=True)}
    fields |= {f"stance_{n}": v for n, v in zip(names, stance, strict=True)}
    out, record = records(dict.fromkeys(names, np.zeros(6)), {"airborne": weight, **fields})
    blend_feedback(at, out, record, record)
    return out


def test_a_blend_is_the_weighted_sum_of_both_torques():
    first, second = RANDOM.random((2, 4, 6))
    weight = RANDOM.random(6)
    position, velocity = RANDOM.normal(size=(2, 6))
    (at,) = records({"position": position, "velocity": velocity})
    out = blended(weight, first, second, at)
    expected = weight * torque(*first, at) + (1.0 - weight) * torque(*second, at)
    found = torque(out.stiffness, out.position, out.damping, out.velocity, at)
    assert found == pytest.approx(expected)
    out = blended(weight, np.zeros((4, 6)), np.zeros((4, 6)), at)
    assert (out.position == at.position).all() and (out.velocity == at.velocity).all()


def test_friction_has_the_sign_of_the_velocity():
    joints, command, params, constants = records(
        {"velocity": [10.0, 0.0, -10.0]},
        {"torque": np.ones(3)},
        {"friction_speed": 0.3},
        {"friction": [0.1, 0.2, 0.3], "viscous_friction": [0.0, 0.1, 0.01]},
    )
    add_friction(joints, command, params, constants)
    assert command.torque == pytest.approx([1.1, 1.0, 0.6])


def test_integrated_targets_are_ahead_by_a_steady_acceleration():
    rest = {"position": [0.0], "velocity": [0.0]}
    joints, follower = records(rest, {**rest, "started": True})
    for _ in range(500):
        integrate_accelerations(np.array([10.0]), joints, follower, 0.02, 0.002)
    assert follower.velocity[0] == pytest.approx(10.0 * 0.02, rel=0.15)
    assert follower.position[0] == pytest.approx(10.0 * 0.02**2, rel=0.15)


@given(
    angle=st.floats(-2.5, 2.5),
    rate=st.floats(-20, 20),
    gains=st.tuples(*[st.floats(0, 100)] * 4),
    targets=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
)
def test_a_soft_stop_adds_its_own_torque_to_any_feedback(angle, rate, gains, targets):
    before = gains[0] * (targets[0] - angle) + gains[1] * (targets[1] - rate)
    joints, command, params, constants = records(
        {"position": [angle]},
        {
            "stiffness": [gains[0]], "position": [targets[0]], "damping": [gains[1]],
            "velocity": [targets[1]],
        },
        {"stop_margin": 0.1, "stop_gain": 2.0},
        {"limits": [[-1.0, 0.5]], "flight_stiffness": [gains[2]], "flight_damping": [gains[3]]},
    )  # fmt: skip
    add_soft_stops(joints, command, params, constants)
    stiffness, damping = command.stiffness[0], command.damping[0]
    after = stiffness * (command.position[0] - angle) + damping * (command.velocity[0] - rate)
    edge = min(max(angle, -0.9), 0.4)
    depth = abs(angle - edge) / 0.1
    added = 2.0 * gains[2] * (edge - angle) - 2.0 * min(depth, 1.0) * gains[3] * rate
    if stiffness > 1e-9 and damping > 1e-9:
        assert after - before == pytest.approx(added, abs=1e-6, rel=1e-9)
