"""What the tests of a plan measure: every change of a plan is found again at its size and its place.

The limits that prevent a larger jump: motors, joints and friction by what the plan does to them.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from aloft.mathematics.constants import GRAVITY
from aloft.planner.checking.evidence import Evidence, body_heights
from aloft.planner.checking.plan_tests import (
    _hits,
    _impact,
    _short,
    _standing_knots,
    active_limits,
    allowed_motor_torque,
    interval_defects,
)
from aloft.planner.checking.replay import held_joints, replay
from aloft.planner.checking.validity import PlanTest, check_plan
from aloft.planner.library.library import SHIPPED
from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.planner.task.margins import Margins
from aloft.planner.task.phase import Phase
from aloft.planner.task.plan import PlannedJump, read_plan
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
JOINTS = [joint.name for joint in ROBOT.joints]
CONTACTS = [contact.name for contact in ROBOT.contacts]


def found(plan: PlannedJump) -> dict[str, PlanTest]:
    return {test.name: test for test in check_plan(plan, ROBOT).tests}


def shifted(plan: PlannedJump, name: str, amount: float, index: object) -> PlannedJump:
    array = getattr(plan, name).copy()
    array[index] += amount
    return replace(plan, **{name: array})


def asked(plan: PlannedJump, **values: object) -> PlannedJump:
    return replace(plan, task=plan.task.model_copy(update=values))


@cache
def shipped(name: str) -> PlannedJump:
    (path,) = SHIPPED.glob(f"{name}-*.npz")
    return read_plan(path)


@pytest.fixture(scope="module")
def evidence(by_hand: PlannedJump) -> Evidence:
    return Evidence(by_hand, ROBOT, replay(by_hand, ROBOT))


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "array", "amount", "index", "where"),
    [
        ("start", "position", 0.01, (0, 8), JOINTS[1]),
        ("start", "position", -0.02, (0, 16), JOINTS[9]),
        ("rest_at_start", "velocity", -0.1, (0, 2), ""),
        ("rest_at_end", "velocity", 0.2, (-1, 10), ""),
        ("com", "com", -1e-3, (3, 1), ""),
        ("com_velocity", "com_velocity", 1e-2, (4, 2), ""),
        ("angular_momentum", "angular_momentum", -2e-3, (5, 0), ""),
        ("joint_torque", "joint_torque", 0.5, (7, 3), JOINTS[3]),
    ],
)
def test_a_shift_of_the_plan_is_the_error_that_is_found(
    by_hand: PlannedJump, name: str, array: str, amount: float, index: tuple[int, int], where: str
) -> None:
    test = found(shifted(by_hand, array, amount, index))[name]
    assert test.value == pytest.approx(abs(amount), abs=test.limit / 10.0)
    assert where in test.where


@pytest.mark.long
def test_another_task_is_missed_by_the_difference(by_hand: PlannedJump, evidence: Evidence) -> None:
    flight_time = by_hand.touchdown_time - by_hand.lift_off_time
    tests = found(asked(by_hand, rise=0.09, distance_x=0.03, twist=0.6, flight_time=0.3))
    assert tests["rise"].value == pytest.approx(0.005, abs=1e-5)
    assert tests["landing_position"].value == pytest.approx(0.03, abs=1e-4)
    assert tests["landing_position"].where == "x"
    assert tests["twist"].value == pytest.approx(0.6, abs=1e-3)
    assert tests["whole_turn"].value == pytest.approx(0.6, abs=1e-3)
    assert tests["flight_time"].value == pytest.approx(abs(flight_time - 0.3), abs=1e-6)
    assert found(asked(by_hand, distance_y=-0.05))["landing_position"].where == "y"
    turned = found(asked(by_hand, rotation=6.28))
    assert turned["rotation"].value == pytest.approx(6.28, abs=0.05) and "whole_turn" not in turned
    for speed in (1.0, 1.8):
        tests = found(asked(by_hand, take_off_speed=speed))
        exact = evidence.replay.com_velocity[evidence.replay.flights[0][0], 2]
        assert tests["take_off_speed"].value == pytest.approx(abs(exact - speed), abs=1e-9)


def test_a_whole_plan_moved_is_as_far_from_the_origin(by_hand: PlannedJump) -> None:
    for axis, amount in ((0, 0.01), (1, -0.02)):
        moved = shifted(by_hand, "position", amount, (slice(None), axis))
        test = found(moved)["origin"]
        assert test.value == pytest.approx(abs(amount), abs=1e-4)
    sunk = found(shifted(by_hand, "position", -0.02, (slice(None), 2)))
    assert sunk["foot_on_ground"].value == pytest.approx(0.02, abs=1e-3)
    assert sunk["foot_below_ground"].value == pytest.approx(0.02, abs=1e-3)


def test_forces_outside_of_their_cone_and_without_contact(by_hand: PlannedJump) -> None:
    knot, point = 20, 1
    lift = max(float(by_hand.contact_force[knot, point, 2]), 0.0)
    sideways = float(by_hand.contact_force[knot, point, 1])
    forward = float(by_hand.contact_force[knot, point, 0])
    test = found(shifted(by_hand, "contact_force", 300.0, (knot, point, 1)))["friction"]
    expected = np.hypot(forward, sideways + 300.0) - by_hand.task.friction * lift
    assert test.value == pytest.approx(expected, rel=1e-9)
    assert test.where == f"{ROBOT.contacts[point].name} at {by_hand.time[knot]:.3f} s"
    test = found(shifted(by_hand, "contact_force", -500.0, (knot, point, 2)))["pull"]
    assert test.value == pytest.approx(500.0 - by_hand.contact_force[knot, point, 2], rel=1e-9)
    flying = int(by_hand.knot_at(by_hand.lift_off_time)) + 3
    test = found(shifted(by_hand, "contact_force", -7.0, (flying, point, 0)))
    assert test["force_without_contact"].value == pytest.approx(7.0)


def test_feet_that_should_arrive_at_rest_have_the_speed_of_the_fall(
    by_hand: PlannedJump, evidence: Evidence
) -> None:
    test = found(asked(by_hand, impact=False))["touchdown_speed"]
    knot = evidence.replay.flights[0][1]
    jacobian = ExactDynamics(ROBOT).contact_jacobians(by_hand.position[knot])[1]
    speeds = np.linalg.norm((jacobian @ by_hand.velocity[knot]).reshape(-1, 3), axis=1)
    assert test.value == pytest.approx(speeds.max(), rel=1e-6)


def test_clearances_grow_with_what_is_asked(by_hand: PlannedJump) -> None:
    feet = found(asked(by_hand, foot_clearance=0.2))["foot_clearance"].value
    assert found(asked(by_hand, foot_clearance=0.25))["foot_clearance"].value == pytest.approx(
        feet + 0.05
    )
    # as in standing, the hips' capsules of 30 mm are the nearest, 151.7 mm from axis to axis
    legs = found(asked(by_hand, leg_clearance=0.09))["leg_clearance"].value
    assert legs == pytest.approx(0.09 - (0.151711 - 2 * 0.03), abs=1e-3)


def test_the_impulse_at_touchdown_leads_to_the_velocities_behind_it() -> None:
    plan = shipped("in_situ")
    knot = int(np.flatnonzero(np.diff(plan.time) == 0.0)[0])
    test = found(plan)["impact"]
    assert test.passed
    for column in (1, 4, 9):
        moved = found(shifted(plan, "velocity", 0.3, (knot + 1, column)))["impact"]
        assert moved.value == pytest.approx(0.3, abs=2 * test.limit)
    place = found(shifted(plan, "position", 0.4, (knot + 1, 9)))["impact"]
    assert place.value == pytest.approx(0.4, abs=2 * test.limit)


def test_the_impulse_of_motors_keeps_joints_still_that_do_not_yield() -> None:
    plan = shipped("in_situ")
    knot = int(np.flatnonzero(np.diff(plan.time) == 0.0)[0])
    q, v = plan.position[knot], plan.velocity[knot]
    dynamics, given = ExactDynamics(ROBOT), replay(plan, ROBOT)
    held = held_joints(plan, knot)
    behind, _ = dynamics.velocity_after_impact(q, v, plan.contact_force[knot], held)
    pushed = dynamics.contact_jacobians(q)[1].T @ plan.contact_force[knot].ravel()
    needed = (dynamics.mass_matrix(q) @ (behind - v) - pushed)[6:]
    assert held.any() and np.abs(needed[held]).min() > 1e-6
    error, kept = _impact(Evidence(plan, ROBOT, given), knot)
    assert error == pytest.approx(np.abs(behind - plan.velocity[knot + 1]).max(), abs=1e-12)
    np.testing.assert_allclose(kept, np.abs(ROBOT.torque_to_motor @ needed), atol=1e-8)
    # Joints that the description holds yield: their motors' impulse counts as none.
    yielding = JOINTS[int(np.flatnonzero(held)[0])]
    robot = ROBOT.model_copy(update={"held": {yielding: 0.0}})
    _, fewer = _impact(Evidence(plan, robot, given), knot)
    without = np.where([name == yielding for name in JOINTS], 0.0, needed)
    np.testing.assert_allclose(fewer, np.abs(ROBOT.torque_to_motor @ without), atol=1e-8)


def test_there_is_no_impact_but_where_two_knots_have_one_time() -> None:
    plan = shipped("in_situ")
    evidence = Evidence(plan, ROBOT, replay(plan, ROBOT))
    knots = np.arange(len(plan.time))
    at = [k for k in knots if np.isfinite(_impact(evidence, int(k))[0])]
    assert at == np.flatnonzero(np.diff(plan.time) == 0.0).tolist()
    error, kept = _impact(evidence, int(knots[-1]))
    assert error == np.inf and kept.tolist() == [0.0] * len(JOINTS)


@pytest.mark.long
def test_the_lowest_point_of_feet_and_body_is_named_with_its_time(by_hand: PlannedJump) -> None:
    sunk = shifted(by_hand, "position", -0.3, (slice(None), 2))
    at = sunk.position.copy()
    at[5, 7 + JOINTS.index("left_ankle")] += 0.2  # one foot turns about its ankle
    sunk = replace(sunk, position=at)
    e, tests = Evidence(sunk, ROBOT, replay(sunk, ROBOT)), found(sunk)
    lowest = {name: float(e.point_height[:, i].min()) for i, name in enumerate(CONTACTS)}
    point = min(lowest, key=lambda name: lowest[name])
    assert tests["foot_below_ground"].value == pytest.approx(-lowest[point], abs=1e-12)
    when = int(e.point_height[:, CONTACTS.index(point)].argmin())
    assert tests["foot_below_ground"].where == f"{point} {e.moment(when)}"
    heights = body_heights(ROBOT, sunk.task, e.shapes, e.progress)
    link, height = min(heights.items(), key=lambda item: float(item[1].min()))
    assert height.min() < 0.0
    assert tests["body_on_ground"].value == pytest.approx(-height.min(), abs=1e-12)
    assert tests["body_on_ground"].where == f"{link} {e.moment(int(height.argmin()))}"
    above = found(by_hand)["body_on_ground"].value
    level = found(shifted(by_hand, "position", -0.3, (slice(None), 2)))["body_on_ground"].value
    assert level - above == pytest.approx(0.3, abs=1e-3)


def test_points_hit_the_ground_as_fast_as_found_by_pinocchio() -> None:
    plan = shipped("in_situ")
    assert plan.task.margins is not None
    knot = int(np.flatnonzero(np.diff(plan.time) == 0.0)[0])
    dynamics = ExactDynamics(ROBOT)
    jacobian = dynamics.contact_jacobians(plan.position[knot])[1]
    speeds = (jacobian @ plan.velocity[knot]).reshape(-1, 3)[plan.contact[knot + 1]]
    margins = plan.task.margins.model_copy(
        update={"touchdown_speed": 0.01, "touchdown_slide": 0.01}
    )
    tests = found(asked(plan, margins=margins))
    assert tests["touchdown_speed"].value == pytest.approx(-speeds[:, 2].min(), abs=1e-6)
    # the feet point ahead, so along and across are x and y
    slide = np.abs(speeds[:, :2]).max()
    assert tests["touchdown_slide"].value == pytest.approx(slide, abs=0.02)
    for name in ("touchdown_speed", "touchdown_slide"):
        assert tests[name].limit == pytest.approx(0.06)


def test_momentum_at_lift_off_and_touchdown_is_compared_with_what_is_allowed() -> None:
    plan = shipped("in_situ")
    dynamics = ExactDynamics(ROBOT)
    ((start, end),) = replay(plan, plan.task.equipped(ROBOT)).flights
    behind = end + int(plan.time[end + 1] == plan.time[end])
    assert behind == end + 1, "there is an impact, and what counts is behind it"
    tests = found(asked(plan, lift_off_momentum=0.001, touchdown_momentum=0.002))
    for name, knot, limit in (
        ("lift_off_momentum", start, 0.001), ("touchdown_momentum", behind, 0.002),
    ):  # fmt: skip
        momentum = dynamics.centroidal(plan.position[knot], plan.velocity[knot])[2]
        assert tests[name].value == pytest.approx(np.abs(momentum).max(), abs=1e-9)
        assert tests[name].limit == pytest.approx(limit + 1e-3)
    without = found(asked(plan, lift_off_momentum=None, touchdown_momentum=None))
    assert not {"lift_off_momentum", "touchdown_momentum"} & set(without)


def test_a_motors_torque_falls_with_its_speed_only_where_it_drives() -> None:
    motors = SimpleNamespace(
        no_load_speed=np.array([30.0]), corner_speed=np.array([10.0]), peak_torque=np.array([8.0])
    )

    def allowed(torque: float, speed: float, effort: float) -> float:
        state = SimpleNamespace(
            motors=motors, motor_torque=np.array([[torque]]), motor_speed=np.array([[speed]])
        )
        return float(allowed_motor_torque(state, effort)[0, 0])  # type: ignore[arg-type]

    for sign in (1.0, -1.0):
        assert allowed(sign, sign * 5.0, 1.0) == 8.0
        assert allowed(sign, sign * 20.0, 1.0) == pytest.approx(4.0)
        assert allowed(sign, sign * 25.0, 1.0) == pytest.approx(2.0)
        assert allowed(sign, sign * 30.0, 1.0) == 0.0
        assert allowed(sign, sign * 40.0, 1.0) == 0.0
        assert allowed(sign, -sign * 40.0, 1.0) == 8.0, "braking is not limited"
        # a share of both torque and speed
        assert allowed(sign, sign * 10.0, 0.5) == pytest.approx(2.0)


def test_motors_do_the_work_of_the_joints(evidence: Evidence) -> None:
    samples = evidence.replay.samples
    power = np.einsum("ij,ij->i", samples.torque, samples.velocity[:, 6:])
    of_motors = np.einsum("ij,ij->i", evidence.motor_torque, evidence.motor_speed)
    np.testing.assert_allclose(of_motors, power, atol=1e-9)


def test_what_the_tests_share(evidence: Evidence, by_hand: PlannedJump) -> None:
    samples = evidence.replay.samples
    landed = samples.time > by_hand.touchdown_time + 1e-6
    assert evidence.progress.min() == 0.0 and evidence.progress.max() == 1.0
    half = 0.5 * (by_hand.lift_off_time + by_hand.touchdown_time)
    assert np.interp(half, samples.time, evidence.progress) == pytest.approx(0.5)
    np.testing.assert_array_equal(evidence.place[landed], 1)
    np.testing.assert_array_equal(evidence.place[samples.time < by_hand.touchdown_time - 1e-6], 0)
    middles = samples.time[evidence.middles]
    lasting = np.diff(by_hand.time) > 0.0
    expected = (0.5 * (by_hand.time[1:] + by_hand.time[:-1]))[lasting]
    np.testing.assert_allclose(middles, expected, atol=1e-9)
    # the apex from lift-off's state is that of the flight's samples
    dynamics = ExactDynamics(ROBOT)
    flying = by_hand.phase[samples.knot] == Phase.FLIGHT
    heights = [
        dynamics.centroidal(q, v)[0][2]
        for q, v in zip(samples.position[flying], samples.velocity[flying], strict=True)
    ]
    assert evidence.rises[0] == pytest.approx(max(heights) - evidence.replay.com[0, 2], abs=1e-4)
    assert evidence.moment(0) == "at 0.000 s"


@pytest.mark.parametrize(("name", "pitch", "yaw"), [
    ("turn_120deg", 0.0, 120.0), ("somersault", 360.0, 0.0), ("somersault_backward_35cm", -360.0, 0.0),
])  # fmt: skip
def test_turns_are_followed_through_whole_circles(name: str, pitch: float, yaw: float) -> None:
    plan = shipped(name)
    robot = plan.task.equipped(find_robot(plan.task.robot))
    turned = np.degrees(Evidence(plan, robot, replay(plan, robot)).turn)
    assert abs(turned[0] - pitch) < 15.0
    assert abs(turned[1] - yaw) < 15.0


def test_figures_are_those_of_the_replay(by_hand: PlannedJump, evidence: Evidence) -> None:
    figures = evidence.figures()
    start, end = evidence.replay.flights[0]
    assert figures["take_off_speed_m_s"] == pytest.approx(np.sqrt(2 * GRAVITY * 0.085), abs=0.3)
    assert figures["duration_s"] == pytest.approx(by_hand.time[-1] - by_hand.time[0])
    assert figures["peak_motor_torque_N_m"] == np.abs(evidence.motor_torque).max()
    assert figures["peak_motor_speed_rad_s"] == np.abs(evidence.motor_speed).max()
    lasting = np.diff(by_hand.time) > 0.0
    forces = by_hand.contact_force[:-1][lasting, :, 2].sum(axis=1)
    assert figures["peak_vertical_force_N"] == pytest.approx(forces.max())
    assert figures["pitch_momentum_at_lift_off_N_m_s"] == evidence.replay.angular_momentum[start, 1]
    assert figures["jumps"] == 1.0 and end > start


def change_of_sole(plan: PlannedJump) -> Callable[..., PlannedJump]:
    return lambda amount: shifted(plan, "position", amount, (20, 1))


@pytest.mark.parametrize("amount", [0.004, -0.006])
def test_a_knot_moved_aside_slips_by_as_much(by_hand: PlannedJump, amount: float) -> None:
    before = found(by_hand)["foot_slip"].value
    slip = found(change_of_sole(by_hand)(amount))["foot_slip"].value
    assert slip == pytest.approx(abs(amount), abs=before + 1e-4)


def test_the_landing_may_have_another_effort() -> None:
    plan = shipped("down_35cm")
    robot = plan.task.equipped(ROBOT)
    evidence = Evidence(plan, robot, replay(plan, robot))
    time = evidence.replay.samples.time
    assert plan.task.landing_effort != plan.task.effort
    before, behind = time < plan.touchdown_time - 1e-6, time > plan.touchdown_time + 1e-6
    assert set(evidence.effort[before, 0]) == {plan.task.effort}
    assert plan.task.landing_effort in evidence.effort[behind, 0]


@pytest.mark.parametrize(
    ("name", "short"),
    [
        ("left_knee_motor", "knee"),
        ("right_hip_pitch_joint", "hip pitch"),
        ("l_ankle", "ankle"),
        ("r_hip_roll", "hip roll"),
        ("waist_yaw_joint", "waist_yaw"),
        ("front_left_knee", "front_left_knee"),
        ("FL_calf_joint", "fore calf"),
        ("rh_kfe_joint", "hind kfe"),
        ("knee", "knee"),
    ],
)
def test_a_limit_is_named_without_the_side(name: str, short: str) -> None:
    assert _short(name) == short


def scaled(plan: PlannedJump, **task: object) -> PlannedJump:
    return replace(plan, task=plan.task.model_copy(update=task))


def test_a_plan_that_is_far_from_all_limits_reaches_none(by_hand: PlannedJump) -> None:
    limits = active_limits(scaled(by_hand, friction=50.0), ROBOT)
    assert "friction" not in limits
    evidence = Evidence(by_hand, ROBOT, replay(by_hand, ROBOT))
    share = np.abs(evidence.motor_speed) / ROBOT.motors.no_load_speed
    fast = {
        _short(name) for name, most in zip(ROBOT.transmission.motors, share.max(axis=0), strict=True)
        if most > 0.985
    }  # fmt: skip
    assert {each.removesuffix(" motor speed") for each in limits if "speed" in each and "at" not in each} == fast  # fmt: skip


def test_less_friction_makes_friction_a_limit_and_the_last_one(by_hand: PlannedJump) -> None:
    force = by_hand.contact_force
    loaded = force[:, :, 2] > 1.0
    used = (np.hypot(force[:, :, 0], force[:, :, 1])[loaded] / force[:, :, 2][loaded]).max()
    # the planner's pyramid lies inside of the cone, so its edges count
    for share, binds in ((0.97, False), (1.03, True)):
        friction = used * np.sqrt(2.0) / 0.985 / share
        limits = active_limits(scaled(by_hand, friction=float(friction)), ROBOT)
        assert ("friction" in limits) == binds
        assert not binds or limits[-1] == "friction"


def test_clearances_and_the_speed_of_touchdown_are_named(by_hand: PlannedJump) -> None:
    evidence = Evidence(by_hand, ROBOT, replay(by_hand, ROBOT))
    middle = int(np.abs(evidence.progress - 0.5).argmin())
    high = float(evidence.point_height[middle].min())
    names = ("foot clearance", "leg clearance", "ground clearance")
    assert not set(names) & set(active_limits(scaled(by_hand, foot_clearance=high - 0.01), ROBOT))
    assert "foot clearance" in active_limits(scaled(by_hand, foot_clearance=high), ROBOT)
    low = body_heights(ROBOT, by_hand.task, evidence.shapes, evidence.progress)
    lowest = min(float(heights.min()) for heights in low.values())
    assert "ground clearance" in active_limits(scaled(by_hand, margins=Margins(step=lowest)), ROBOT)


def test_less_effort_makes_motors_a_limit_the_more_the_less(by_hand: PlannedJump) -> None:
    evidence = Evidence(by_hand, ROBOT, replay(by_hand, ROBOT))
    middle = evidence.middles
    torque = np.abs(evidence.motor_torque[middle]) / ROBOT.motors.peak_torque
    strongest = _short(ROBOT.transmission.motors[int(torque.max(axis=0).argmax())])
    sets = [set(active_limits(scaled(by_hand, effort=share), ROBOT)) for share in (1.0, 0.7, 0.4)]
    motors = [{each for each in found if "motor" in each} for found in sets]
    assert any(each.startswith(f"{strongest} motor torque") for each in motors[2])
    assert len(motors[0]) < len(motors[2])


@pytest.mark.parametrize(("joint", "side"), [(0, 0), (3, 1)])
def test_a_joint_that_stays_at_its_limit_is_named(
    by_hand: PlannedJump, joint: int, side: int
) -> None:
    name = f"{_short(ROBOT.joints[joint].name)} joint limit"
    assert name not in active_limits(by_hand, ROBOT)
    position = by_hand.position.copy()
    position[:, 7 + joint] = ROBOT.joint_limits[joint, side]
    assert name in active_limits(replace(by_hand, position=position), ROBOT)


@pytest.fixture(scope="module")
def two_jumps() -> Evidence:
    """Up a step of 5 cm and down again behind it."""
    plan = shipped("up_and_down")
    robot = plan.task.equipped(ROBOT)
    return Evidence(plan, robot, replay(plan, robot))


def test_two_jumps_are_followed_one_after_the_other(two_jumps: Evidence) -> None:
    plan, samples = two_jumps.plan, two_jumps.replay.samples
    (first, landed), (second, end) = plan.flights
    times = [
        0.0,
        first,
        0.5 * (first + landed),
        landed,
        second,
        0.5 * (second + end),
        end,
        plan.time[-1],
    ]
    progress = np.interp(times, samples.time, two_jumps.progress)
    np.testing.assert_allclose(progress, [0.0, 0.0, 0.5, 1.0, 1.0, 1.5, 2.0, 2.0], atol=1e-9)
    place = two_jumps.place
    np.testing.assert_array_equal(
        place, (samples.time >= landed).astype(int) + (samples.time >= end)
    )
    assert two_jumps.rises == pytest.approx([0.08, 0.06], abs=1e-6)
    # both times where feet stand, their points are on the ground, which is higher in between
    standing = plan.contact[samples.knot] & (plan.phase[samples.knot] != Phase.FLIGHT)[:, None]
    assert np.abs(two_jumps.point_height[standing]).max() < 1e-3
    between = (samples.time > landed + 0.01) & (samples.time < second - 0.01)
    assert samples.points[between][:, :, 2].min() > 0.049


def test_feet_of_several_jumps_rest_at_each_place_by_itself(two_jumps: Evidence) -> None:
    assert found(two_jumps.plan)["foot_slip"].value < 1e-3


def test_the_feet_stand_between_two_jumps_until_the_first_heel_lifts() -> None:
    contact = np.zeros((14, 2), bool)
    contact[4:10] = True
    contact[8:10, 1] = False  # the heels lift at knot 8
    flights = ((1, 4), (10, 12))
    given = SimpleNamespace(
        replay=SimpleNamespace(flights=flights), plan=SimpleNamespace(contact=contact)
    )
    assert _standing_knots(given) == [8]  # type: ignore[arg-type]
    contact[4:10, 1] = False
    assert _standing_knots(given) == [10]  # type: ignore[arg-type]
    given.replay.flights = ((1, 4),)
    assert _standing_knots(given) == []  # type: ignore[arg-type]


@pytest.mark.parametrize(("jump", "amount"), [(0, 0.05), (1, -0.04)])
def test_the_jump_that_misses_its_task_is_named(
    two_jumps: Evidence, jump: int, amount: float
) -> None:
    plan, ends = two_jumps.plan, two_jumps.replay.flights
    lift_off, touchdown = ends[jump]
    faster = shifted(plan, "velocity", amount, (lift_off, 2))
    tests = found(faster)
    speed = two_jumps.replay.com_velocity[lift_off, 2]
    q, v = faster.position[lift_off], faster.velocity[lift_off]
    other = ExactDynamics(ROBOT).centroidal(q, v)[1][2]
    missed = (other**2 - speed**2) / (2.0 * GRAVITY)
    assert tests["rise"].where == f" jump {jump + 1}"
    assert tests["rise"].value == pytest.approx(abs(missed), abs=1e-6)
    # all stances behind that flight are moved aside
    for axis, name in ((0, "x"), (1, "y")):
        tests = found(shifted(plan, "position", amount, (slice(touchdown, None), axis)))
        assert tests["landing_position"].value == pytest.approx(abs(amount), abs=1e-3)
        assert tests["landing_position"].where in {f"{name} jump {k + 1}" for k in range(jump, 2)}
    moved = found(shifted(plan, "position", 0.3, (touchdown + 1, 9)))
    assert moved["impact"].where == f" jump {jump + 1}"


def test_no_limit_is_negative(by_hand: PlannedJump, two_jumps: Evidence) -> None:
    for plan in (two_jumps.plan, by_hand, asked(by_hand, formulation="full")):
        for test in check_plan(plan, ROBOT).tests:
            assert test.limit > 0.0 or test.name == "body_on_ground", test


def test_the_clearance_of_the_feet_is_that_in_the_middle_of_each_flight(
    two_jumps: Evidence,
) -> None:
    plan, samples = two_jumps.plan, two_jumps.replay.samples
    lowest = []
    for start, end in plan.flights:
        k = int(np.abs(samples.time - 0.5 * (start + end)).argmin())
        lowest.append(two_jumps.point_height[k].min())
    test = found(asked(plan, foot_clearance=0.3))["foot_clearance"]
    assert test.value == pytest.approx(0.3 - min(lowest), abs=1e-9)


@pytest.mark.parametrize(("joint", "side"), [(0, 0), (0, 1), (3, 0), (3, 1), (9, 1)])
def test_a_joint_beyond_either_limit_is_named(by_hand: PlannedJump, joint: int, side: int) -> None:
    limits = ROBOT.joint_limits
    position = by_hand.position.copy()
    position[10, 7 + joint] = limits[joint, side] + (0.2 if side else -0.2)
    test = found(replace(by_hand, position=position))["joint_limits"]
    assert test.value == pytest.approx(0.2) and test.where.startswith(f"{JOINTS[joint]} at ")


def test_the_hardest_motors_are_named(by_hand: PlannedJump, evidence: Evidence) -> None:
    tests, motors = found(by_hand), ROBOT.transmission.motors
    speed = np.abs(evidence.motor_speed)
    sample, motor = np.unravel_index(int(speed.argmax()), speed.shape)
    assert len(set(ROBOT.motors.no_load_speed)) == 1, "else shares would have to be compared"
    time = evidence.replay.samples.time[sample]
    assert tests["motor_speed"].value == pytest.approx(speed.max())
    assert tests["motor_speed"].where.endswith(f"{time:.3f} s")
    assert tests["motor_speed"].where.split()[0] in motors
    half = found(asked(by_hand, effort=0.5))
    assert half["motor_speed"].limit == pytest.approx(
        1.01 * 0.5 * ROBOT.motors.no_load_speed[motor]
    )


def test_what_one_interval_may_err_is_as_documented(evidence: Evidence) -> None:
    found = {each.name: (each.limit, each.unit) for each in interval_defects(evidence)}
    assert found == {
        "position_defect": (1e-3, "m"),
        "rotation_defect": (pytest.approx(np.radians(0.5)), "rad"),
        "velocity_defect": (0.05, "m/s"),
        "angular_velocity_defect": (0.5, "rad/s"),
    }


@pytest.mark.parametrize(
    ("heading", "slide"), [(0.0, 1.1), (0.1, 1.1 * np.cos(0.1) - 0.5 * np.sin(0.1))]
)
def test_feet_slide_at_touchdown_in_the_heading_where_they_shall_stand(
    heading: float, slide: float
) -> None:
    """As the planner bounds it: a base that yaws in flight turns no ball, and once made plans fail."""
    task = SimpleNamespace(
        margins=Margins(touchdown_speed=0.6, touchdown_slide=1.1),
        places=lambda: [None, SimpleNamespace(slope=(0.0, 0.0), heading=heading)],
    )
    plan = SimpleNamespace(task=task, time=np.array([0.0, 0.1]), contact=np.array([[0, 0], [1, 0]]))
    velocity = np.array([[[0.5, 1.1, -0.4], [9.0, 9.0, -9.0]]])
    samples = SimpleNamespace(time=np.array([0.0]), point_velocity=velocity)
    evidence = SimpleNamespace(plan=plan, replay=SimpleNamespace(samples=samples))
    fast = {test.name: test.value for test in _hits(evidence, [0])}  # type: ignore[arg-type]
    assert fast == pytest.approx({"touchdown_speed": 0.4, "touchdown_slide": slide})
