"""The tests that a plan must pass. Each states what is measured, where, and the value allowed.

The allowed values are errors that the robot's feedback corrects without effort. They are not the solver's
tolerances, which are far smaller.
The end of the file names the limits of the robot that a plan reaches: they prevent a larger jump.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...robots.kinematics import fall_height
from ..models.link_shapes import arms
from ..task.margins import Margins, joint_bounds
from ..task.phase import Phase
from ..task.plan import PlannedJump
from ..task.scaling import per_robot
from ..task.sequence import ground_axes
from .evidence import (
    DEGREE,
    MILLIMETRE,
    Evidence,
    PlanTestResult,
    arm_clearance_deficit,
    body_heights,
    leg_clearance_deficit,
    worst,
)
from .replay import replay

HIT_TOLERANCE = 0.05
"""Margin by which feet may be faster at touchdown than the task's margins [m/s]."""
SHORTEST_IMPACT = 0.004
"""s; as long as the feet's contact takes to stop them at least. What a motor can do in that time
bounds its impulse at touchdown."""


def start_and_end(e: Evidence) -> Iterator[PlanTestResult]:
    """Test that the plan begins at rest in its stance over the origin and ends at rest."""
    plan, joints = e.plan, [joint.name for joint in e.robot.joints]
    missed = np.abs(plan.position[0, 7:] - e.start_joints)
    yield PlanTestResult("start", missed.max(), 1e-3, "rad", "the first knot's distance from the stance",
                joints[int(missed.argmax())])  # fmt: skip
    middle = np.append(e.replay.soles[0].mean(axis=0), e.replay.heading[0].mean())
    yield PlanTestResult("origin", float(np.abs(middle).max()), MILLIMETRE, "m or rad",
                "the first knot's distance from the origin between the soles")  # fmt: skip
    ends, moved = e.plan.task.end_joints(e.robot), [link for arm in arms(e.robot) for link in arm]
    if free := [k for k, joint in enumerate(e.robot.joints) if joint.child in moved]:
        missed = np.abs(plan.position[-1, 7:] - [ends[name] for name in joints])[free]
        yield PlanTestResult("end", missed.max(), 1e-3, "rad",
                    "the last knot's distance from the stance, of joints in no leg",
                    joints[free[int(missed.argmax())]])  # fmt: skip
    for name, knot in (("rest_at_start", 0), ("rest_at_end", -1)):
        speeds = np.abs(plan.velocity[knot])
        yield PlanTestResult(name, speeds.max(), 1e-2, "m/s or rad/s", "the largest velocity")


def states(e: Evidence) -> Iterator[PlanTestResult]:
    """Test that centre of mass, momentum and torque agree with those that Pinocchio computes from states and forces."""
    plan, r = e.plan, e.replay
    for name, planned, exact, limit, unit in (
        ("com", plan.com, r.com, 1e-5, "m"),
        ("com_velocity", plan.com_velocity, r.com_velocity, 1e-4, "m/s"),
        ("angular_momentum", plan.angular_momentum, r.angular_momentum, 1e-5, "N m s"),
    ):
        yield PlanTestResult(
            name, np.abs(planned - exact).max(), limit, unit, "its error at the knots"
        )
    s = r.samples
    missed = np.abs(s.torque[e.middles] - plan.joint_torque[s.knot[e.middles]])
    most = np.maximum(0.2, 0.01 * e.motors.peak_torque)
    k, joint = worst(missed / most)
    yield PlanTestResult("joint_torque", missed[k, joint], most[joint], "N m",
                "its error in the middle of an interval",
                f"{e.robot.joints[joint].name} {e.moment(int(e.middles[k]))}")  # fmt: skip


def interval_defects(e: Evidence) -> Iterator[PlanTestResult]:
    """Test that exact dynamics from each knot lead to the next."""
    for column, (name, limit, unit) in enumerate(
        (
            ("position_defect", MILLIMETRE, "m"),
            ("rotation_defect", 0.5 * DEGREE, "rad"),
            ("velocity_defect", 0.05, "m/s"),
            ("angular_velocity_defect", 0.5, "rad/s"),
        )
    ):
        found = e.replay.defect[:, column]
        k = int(found.argmax())
        yield PlanTestResult(name, found[k], limit, unit, "the base's error after one interval",
                    f"from {e.plan.time[k]:.3f} s")  # fmt: skip


def discretisation(e: Evidence) -> Iterator[PlanTestResult]:
    """Test the planner's own equations on the ground, of the formulation that is built on them; in the air it conserves
    momentum, as exact dynamics do.
    """
    if e.plan.task.formulation != "full":
        return
    grounded = e.plan.phase[:-1] != Phase.FLIGHT
    gap, wrench = e.replay.gap * grounded, e.replay.wrench * grounded
    for name, found, limit, unit, text in (
        ("violation", gap, 1e-6, "m or rad", "what the states miss of a constant acceleration"),
        (
            "force_balance",
            wrench,
            e.model_error(1e-3, 1e-3 * e.robot.weight),
            "N or N m",
            "what forces miss in an interval's middle",
        ),
    ):
        k = int(found.argmax())
        yield PlanTestResult(name, found[k], limit, unit, text, f"from {e.plan.time[k]:.3f} s")


def flight(e: Evidence) -> Iterator[PlanTestResult]:
    """Test that the whole flight by exact dynamics ends at the plan's touchdown."""
    plan, r = e.plan, e.replay
    position, rotation = (max(errors) for errors in zip(*r.flight_errors, strict=True))
    yield PlanTestResult(
        "flight_position", position, MILLIMETRE, "m", "the base's error at touchdown"
    )
    yield PlanTestResult(
        "flight_rotation", rotation, 0.5 * DEGREE, "rad", "the base's error at touchdown"
    )
    knots = plan.time[np.array(r.flights)]
    missed = np.abs(knots - plan.flights).max() if knots.shape == np.shape(plan.flights) else np.inf
    yield PlanTestResult(
        "flight_times", float(missed), 1e-9, "s", "lift-off and touchdown from their knots"
    )


def task_done(e: Evidence) -> Iterator[PlanTestResult]:
    """Test that every jump reaches the height, place, heading and rotation of the task."""
    task, r = e.plan.task, e.replay
    hops, places = task.hops(), task.places()
    for name, missed, limit, unit, text in (
        ("rise", [(e.rises[i], hop.rise) for i, hop in enumerate(hops)], MILLIMETRE, "m",
         "how far the apex, from the state at lift-off, misses the one asked for"),
        ("take_off_speed", [(float(r.com_velocity[r.flights[i][0], 2]), hop.take_off_speed)
                            for i, hop in enumerate(hops)], 5e-3, "m/s", "its error"),
        ("flight_time", [(end - start, hop.flight_time) for (start, end), hop
                         in zip(e.plan.flights, hops, strict=True)], MILLIMETRE, "s", "its error"),
    ):  # fmt: skip
        errors = [abs(found - wanted) for found, wanted in missed if wanted is not None]
        if errors:
            yield PlanTestResult(
                name, max(errors), limit, unit, text, _which(e, int(np.argmax(errors)))
            )
    least = None if task.margins is None else task.margins.lift_off_speed
    if least is not None:
        slowest = min(float(r.com_velocity[start, 2]) for start, _ in r.flights)
        yield PlanTestResult(
            "lift_off_speed", least - slowest, 5e-3, "m/s", "what it lacks of the least one"
        )
    standing = [*_standing_knots(e), -1]
    goals = np.array([(place.x, place.y, place.z) for place in places[1:]])
    missed_by = np.abs(r.soles[standing].mean(axis=1) - goals)
    jump, axis = worst(missed_by)
    yield PlanTestResult("landing_position", missed_by.max(), 3 * MILLIMETRE, "m", "the feet's distance from it",
                "xyz"[axis] + _which(e, jump))  # fmt: skip
    pitch, yaw = e.turn
    turned = (r.heading[standing] - r.heading[0]).mean(axis=1)
    # Through a somersault a heading is not defined, so it counts as it is at the end.
    twists = [math.remainder(t - place.heading, math.tau)
              for t, place in zip(turned, places[1:], strict=True)]  # fmt: skip
    yield PlanTestResult("twist", float(np.abs(twists).max()), 0.5 * DEGREE, "rad",
                "the feet's error in heading")  # fmt: skip
    rotation = places[-1].turned
    if any(hop.rotation for hop in hops):
        yield PlanTestResult(
            "rotation", abs(pitch - rotation), 5 * DEGREE, "rad", "the body's error"
        )
    else:
        yield PlanTestResult("whole_turn", abs(yaw - places[-1].heading), 20 * DEGREE, "rad",
                    "how far the torso's turn differs from the feet's")  # fmt: skip


def _standing_knots(e: Evidence) -> list[int]:
    """Return, after each jump but the last, the last knot at which all contact points are on the ground: in a later
    part of the thrust the heels may have left it. The lift-off where there is no such knot.
    """
    found = []
    for (_, touchdown), (lift_off, _) in zip(e.replay.flights, e.replay.flights[1:], strict=False):
        level = np.flatnonzero(e.plan.contact[touchdown:lift_off].all(axis=1))
        found.append(touchdown + int(level[-1]) + 1 if len(level) else lift_off)
    return found


def _which(e: Evidence, jump: int) -> str:
    """Return the number of one of several jumps as words."""
    return f" jump {jump + 1}" if len(e.replay.flights) > 1 else ""


def contacts(e: Evidence) -> Iterator[PlanTestResult]:
    """Test that feet stay where they stand, on the ground, and push only there, within the friction cone."""
    plan, s = e.plan, e.replay.samples
    names = [contact.name for contact in e.robot.contacts]
    loaded = plan.contact[s.knot]
    flying = plan.phase[s.knot] == Phase.FLIGHT
    standing = loaded & ~flying[:, None]
    begins, there = np.flatnonzero(np.diff(e.place, prepend=-1)), standing[:, :, None]
    most = np.maximum.reduceat(np.where(there, e.resting, -np.inf), begins)
    least = np.minimum.reduceat(np.where(there, e.resting, np.inf), begins)
    slip = np.maximum((most - least).max(axis=(0, 2)), 0.0)
    yield PlanTestResult("foot_slip", slip.max(), 3 * MILLIMETRE, "m", "how far a loaded point moves",
                names[int(slip.argmax())])  # fmt: skip
    height = np.where(standing, np.abs(e.point_height), 0.0)
    yield PlanTestResult("foot_on_ground", height.max(), 2 * MILLIMETRE, "m",
                "how far a loaded point is off the ground")  # fmt: skip
    force = e.forces
    idle = np.where(plan.contact[:, :, None], 0.0, np.abs(force)).max()
    yield PlanTestResult(
        "force_without_contact", idle, 1e-6, "N", "the largest force on an unloaded point"
    )
    pull, tangent = -force[:, :, 2], np.hypot(force[:, :, 0], force[:, :, 1])
    yield PlanTestResult("pull", pull.max(), 1e-3, "N", "how hard a foot pulls at the ground")
    excess = tangent - plan.task.friction * np.maximum(force[:, :, 2], 0.0)
    k, number = worst(excess)
    yield PlanTestResult("friction", excess.max(), 1e-2, "N", "how far a force is outside its cone",
                f"{names[number]} at {plan.time[k]:.3f} s")  # fmt: skip


def touchdown(e: Evidence) -> Iterator[PlanTestResult]:
    """Test that feet which are to arrive at rest do, and that those that may hit the ground are slow enough."""
    plan, r, s = e.plan, e.replay, e.replay.samples
    knots = [touchdown for _, touchdown in r.flights]
    if plan.task.impact:
        if plan.task.formulation != "full":
            return
        found = [_impact(e, k) for k in knots]
        k = int(np.argmax([error for error, _ in found]))
        yield PlanTestResult("impact", found[k][0], e.model_error(1e-3, 1e-2), "m/s or rad/s",
                    "how far the impulse's velocities miss exact dynamics'", _which(e, k))  # fmt: skip
        kept = np.array([impulse for _, impulse in found])
        most = plan.task.landing_effort * e.motors.peak_torque * SHORTEST_IMPACT
        k, motor = worst(kept / most)
        yield PlanTestResult("held_joints", kept[k, motor], most[motor], "N m s",
                    "the impulse of a motor whose joint keeps still",
                    e.robot.transmission.motors[motor] + _which(e, k))  # fmt: skip
        yield from _hits(e, knots)
        return
    samples = np.searchsorted(s.time, plan.time[knots] - 1e-9)
    speeds = np.linalg.norm(s.point_velocity[samples], axis=2)
    speeds = np.where(plan.contact[knots], speeds, 0.0)
    yield PlanTestResult(
        "touchdown_speed", float(speeds.max()), 0.05, "m/s", "the feet's speed at touchdown"
    )


def _hits(e: Evidence, knots: list[int]) -> Iterator[PlanTestResult]:
    """Test the speeds at which points hit the ground, downwards and along or across the heading in which their feet
    shall stand, where bounded. Balls have no heading of their own, and the base may yaw in flight.
    """
    margins, s = e.plan.task.margins, e.replay.samples
    if margins is None:
        return
    fast = np.zeros(3)
    for knot, place in zip(knots, e.plan.task.places()[1:], strict=True):
        speeds = s.point_velocity[np.searchsorted(s.time, e.plan.time[knot] - 1e-9)]
        axes = ground_axes(place.slope, place.heading)
        landing = speeds[np.asarray(e.plan.contact[knot + 1], bool)] @ axes
        along, across, up = landing.T
        fast = np.maximum(fast, [(-up).max(), abs(along).max(), abs(across).max()])
    for name, found, most, what in (
        ("touchdown_speed", fast[0], margins.touchdown_speed, "downwards"),
        ("touchdown_slide", fast[1:].max(), margins.touchdown_slide, "along or across the foot"),
    ):
        if most is not None:
            text = f"how fast a point hits the ground {what}"
            yield PlanTestResult(name, float(found), most + HIT_TOLERANCE, "m/s", text)


def _impact(e: Evidence, knot: int) -> tuple[float, Array]:
    """Return the error of all generalised velocities behind the impulse at a knot, infinite where there is no impact,
    and every motor's impulse that keeps a joint still [N m s] (n_joints,).

    Joints that the description holds yield a little under an impact and come back: the impulse
    of their motors counts as none.
    """
    plan = e.plan
    if knot + 1 >= len(plan.time) or plan.time[knot + 1] > plan.time[knot]:
        return math.inf, np.zeros(len(e.robot.joints))
    exact, kept = e.replay.impacts[knot]
    kept = kept.copy()
    moved = np.abs(plan.position[knot + 1] - plan.position[knot]).max()
    error = max(np.abs(exact - plan.velocity[knot + 1]).max(), moved)
    kept[[joint.name in e.robot.held for joint in e.robot.joints]] = 0.0
    return float(error), np.abs(e.robot.torque_to_motor @ kept)


def momentum(e: Evidence) -> Iterator[PlanTestResult]:
    """Test that the angular momentum at lift-offs and touchdowns is no more than the task allows."""
    task, r = e.plan.task, e.replay
    lasting = np.diff(e.plan.time, append=np.inf) > 0.0
    ends = [stop + int(not lasting[stop]) for _, stop in r.flights]
    for name, knots, most in (
        ("lift_off_momentum", [start for start, _ in r.flights], task.lift_off_momentum),
        ("touchdown_momentum", ends, task.touchdown_momentum),
    ):
        if most is not None:
            found = float(np.abs(r.angular_momentum[knots]).max())
            yield PlanTestResult(
                name, found, most + 1e-3, "N m s", "the angular momentum about an axis"
            )


def machine(e: Evidence) -> Iterator[PlanTestResult]:
    """Test that joints stay within their limits, and motors within what they can do at their speed."""
    robot, s = e.robot, e.replay.samples
    angles, limits = s.position[:, 7:], robot.joint_limits
    excess = np.maximum(angles - limits[:, 1], limits[:, 0] - angles)
    sample, joint = worst(excess)
    yield PlanTestResult("joint_limits", excess.max(), 5e-3, "rad", "how far a joint passes its limit",
                f"{robot.joints[joint].name} {e.moment(sample)}")  # fmt: skip
    motors = e.motors
    # Each motor is compared with its own limits: as a share where they may differ.
    share = np.abs(e.motor_speed) / motors.no_load_speed
    sample, motor = worst(share / e.effort)
    yield PlanTestResult("motor_speed", share[sample, motor] * motors.no_load_speed[motor],
                1.01 * e.effort[sample, 0] * motors.no_load_speed[motor], "rad/s", "the largest motor speed",
                f"{robot.transmission.motors[motor]} {e.moment(sample)}")  # fmt: skip
    peak = motors.peak_torque
    over = np.abs(e.motor_torque) - allowed_motor_torque(e, 1.0)
    sample, motor = worst(over / peak)
    yield PlanTestResult("motor_torque", over[sample, motor], 0.03 * peak[motor], "N m",
                "how far a motor torque passes what its speed allows",
                f"{robot.transmission.motors[motor]} {e.moment(sample)}")  # fmt: skip
    # The share that is kept for feedback is a matter of whole intervals, not of their ends.
    middle = e.middles
    over = np.abs(e.motor_torque[middle]) - allowed_motor_torque(e, e.effort)[middle]
    sample, motor = worst(over / peak)
    yield PlanTestResult("effort", over[sample, motor], 0.01 * peak[motor], "N m",
                "how far a motor torque passes the share of it that the task allows",
                f"{robot.transmission.motors[motor]} {e.moment(int(middle[sample]))}")  # fmt: skip


def allowed_motor_torque(e: Evidence, effort: float | Array) -> Array:
    """Return the torque [N m] that a share of the motors' abilities allows at the samples' speeds."""
    motors = e.motors
    # Braking torque is the peak at any speed; driving torque falls between corner and no load.
    driving = np.sign(e.motor_torque) * e.motor_speed / effort
    fall = (motors.no_load_speed - driving) / (motors.no_load_speed - motors.corner_speed)
    return np.asarray(effort * motors.peak_torque * np.clip(fall, 0.0, 1.0))


_fall_height = per_robot(fall_height)


def clearances(e: Evidence) -> Iterator[PlanTestResult]:
    """Test that only the feet come near the ground, that they clear it in flight, and that legs stay apart."""
    robot, task = e.robot, e.plan.task
    names = [contact.name for contact in robot.contacts]
    low = -e.point_height
    sample, number = worst(low)
    yield PlanTestResult("foot_below_ground", low.max(), MILLIMETRE, "m", "how deep a foot is",
                f"{names[number]} {e.moment(sample)}")  # fmt: skip
    at = [int(np.abs(e.progress - 0.5 - i).argmin()) for i in range(len(e.plan.flights))]
    missing = task.foot_clearance - e.point_height[at].min(axis=0)
    yield PlanTestResult("foot_clearance", missing.max(), MILLIMETRE, "m",
                "what the feet lack of the clearance asked for in the middle of the flight",
                names[int(missing.argmax())])  # fmt: skip
    heights = body_heights(robot, task, e.shapes, e.progress)
    if heights:
        link = min(heights, key=lambda name: float(heights[name].min()))
        sample = int(heights[link].argmin())
        yield PlanTestResult("body_on_ground", -float(heights[link][sample]), 0.0, "m",
                    "how deep the body is in the ground", f"{link} {e.moment(sample)}")  # fmt: skip
    low = _fall_height(robot) - e.base_height
    yield PlanTestResult("base_height", float(low.max()), MILLIMETRE, "m",
                "how far the base is below the height that counts as a fall", e.moment(int(low.argmax())))  # fmt: skip
    deficit = leg_clearance_deficit(robot, e.shapes, task.leg_clearance)
    if deficit is not None:  # else no two legs have shapes that could touch
        sample = int(deficit.argmax())
        yield PlanTestResult("leg_clearance", float(deficit[sample]), MILLIMETRE, "m",
                    "what the legs lack of the gap asked for", e.moment(sample))  # fmt: skip
    swung = arm_clearance_deficit(robot, e.shapes, task.leg_clearance) if task.moving else None
    if swung is not None:
        deficit, link = swung
        sample = int(deficit.argmax())
        yield PlanTestResult("arm_clearance", float(deficit[sample]), MILLIMETRE, "m",
                    "what moving arms lack of that gap to the rest of the body",
                    f"{link} {e.moment(sample)}")  # fmt: skip


PLAN_TESTS: tuple[Callable[[Evidence], Iterator[PlanTestResult]], ...] = (
    start_and_end, states, interval_defects, discretisation, flight, task_done, contacts, touchdown,
    momentum, machine, clearances,
)  # fmt: skip
"""Tests in the order of the report."""


NEAR = 0.985
"""The share of a limit from which it counts as reached."""
NEAR_LIMIT = 0.01
"""Distance from a joint's limit at which it counts as reached [rad]."""
LEAST_TIME = 0.02
"""Share of the plan's instants that must be at a limit for it to be named."""
LEAST_GAP = 0.002
"""m that calves keep from the ground where the task's margins say nothing."""
SIDES = {
    "left": "", "right": "", "l": "", "r": "",
    **dict.fromkeys(("fl", "fr", "lf", "rf"), "fore"), **dict.fromkeys(("rl", "rr", "hl", "hr", "lh", "rh"), "hind"),
}  # fmt: skip
"""Side or pair of legs by the first word of a joint's or motor's name."""


def active_limits(plan: PlannedJump, robot: RobotDescription) -> tuple[str, ...]:
    """Return what the plan uses to the full: the motors whose torque or speed, and the joints whose limits, it reaches,
    by their names without the side, in the robot's order; then clearances, touchdown speed, and friction.
    """
    robot = plan.task.equipped(robot)
    evidence = Evidence(plan, robot, replay(plan, robot))
    effort, motors = evidence.effort, evidence.motors
    middle = evidence.middles
    allowed = np.maximum(allowed_motor_torque(evidence, effort)[middle], 1e-6)
    falling = allowed < NEAR * effort[middle] * motors.peak_torque
    full = np.abs(evidence.motor_torque[middle]) > NEAR * allowed
    fast = np.abs(evidence.motor_speed) > NEAR * effort * motors.no_load_speed
    found = list[str]()
    for k, name in enumerate(robot.transmission.motors):
        if (full & falling)[:, k].any():
            found.append(f"{_short(name)} motor torque at speed")
        elif full[:, k].any():
            found.append(f"{_short(name)} motor torque")
        if fast[:, k].any():
            found.append(f"{_short(name)} motor speed")
    margins = plan.task.margins or Margins()
    bounds = joint_bounds(robot, margins, False)
    angles = evidence.replay.samples.position[:, 7:]
    near = (angles < bounds[:, 0] + NEAR_LIMIT) | (angles > bounds[:, 1] - NEAR_LIMIT)
    for k, joint in enumerate(robot.joints):
        if near[:, k].mean() > LEAST_TIME and joint.name not in robot.held:
            found.append(f"{_short(joint.name)} joint limit")
    found += [f"{name} clearance" for name in _narrow(evidence)]
    knots = [touchdown for _, touchdown in evidence.replay.flights]
    if plan.task.impact:
        found += [
            test.name.replace("_", " ")
            for test in _hits(evidence, knots)
            if test.value > NEAR * (test.limit - HIT_TOLERANCE)
        ]
    force = evidence.forces
    loaded = force[:, :, 2] > 1.0
    used = np.hypot(force[:, :, 0], force[:, :, 1]) / np.maximum(force[:, :, 2], 1e-9)
    if bool((used > NEAR * plan.task.friction / np.sqrt(2.0))[loaded].any()):
        found.append("friction")
    return tuple(dict.fromkeys(found))


def _narrow(e: Evidence) -> Iterator[str]:
    """Yield the clearances at which the plan keeps no more than the task's gap: ``foot`` and ground in the middle of
    the flight, ``ground`` and the lowest part of the body, ``base`` and the height that counts as a fall, ``leg`` and
    leg. What starts as near does not count.
    """
    robot, task = e.robot, e.plan.task
    gap = (task.margins or Margins()).step
    at = [int(np.abs(e.progress - 0.5 - i).argmin()) for i in range(len(e.plan.flights))]
    if e.point_height[at].min() < task.foot_clearance + MILLIMETRE:
        yield "foot"
    heights = body_heights(robot, task, e.shapes, e.progress).values()
    lowest = np.min(list(heights), axis=0) if heights else np.full(1, np.inf)
    for name, height, least in (
        ("ground", lowest, LEAST_GAP if gap is None else gap),
        ("base", e.base_height, fall_height(robot) + (gap or 0.0)),
    ):
        if height.min() < least + MILLIMETRE < height[0]:
            yield name
    deficit = leg_clearance_deficit(robot, e.shapes, task.leg_clearance)
    if deficit is not None and deficit[0] < -MILLIMETRE < deficit.max():
        yield "leg"


def _short(name: str) -> str:
    """Return a name without its side: both sides bind alike more often than not. Of four legs the pair is named."""
    name = name.removesuffix("_motor").removesuffix("_joint")
    side, _, rest = name.partition("_")
    if not rest or side.lower() not in SIDES:
        return name
    return f"{SIDES[side.lower()]} {rest.replace('_', ' ')}".strip()
