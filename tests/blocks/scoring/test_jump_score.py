"""Every criterion on made-up truth: a good jump, or row of jumps, passes, and each criterion can fail alone."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from aloft.blocks.scoring.jump_score import JumpScore
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing.bench import BlockBench

PERIOD = 0.002
LIFT_OFF = 1.0
SPEED = 1.2
TOUCHDOWN = LIFT_OFF + 2 * SPEED / 9.81
STANDING = 0.3287
WEIGHT = 5.118 * 9.81
FEET = np.array([[0.0425, -0.076], [-0.0425, -0.076], [0.0425, 0.076], [-0.0425, 0.076]])
Fields = dict[str, Any]
Change = Callable[[float, Fields], None]


def quaternion(angle: float, axis: int = 1) -> list[float]:
    """The turn by ``angle`` about one axis of the world, as x, y, z, w."""
    values = [0.0, 0.0, 0.0, math.cos(angle / 2)]
    values[axis] = math.sin(angle / 2)
    return values


def in_air(time: float) -> bool:
    """Whether the whole tick that ends at ``time`` is spent in the air."""
    return LIFT_OFF + PERIOD - 1e-9 <= time < TOUCHDOWN


def com_of(time: float) -> tuple[float, float]:
    """Height and vertical speed of the centre of mass of the perfect jump."""
    if time < 0.5 or time > TOUCHDOWN:
        return STANDING, 0.0
    if time < LIFT_OFF:
        return STANDING - 0.08 * (1 - abs(time - 0.75) / 0.25), 0.0 if time < 0.75 else SPEED
    flown = time - LIFT_OFF
    return STANDING + SPEED * flown - 9.81 / 2 * flown**2, SPEED - 9.81 * flown


LEAN = quaternion(0.01)
ON_GROUND: Fields = {
    "contact_position": np.column_stack([FEET, np.zeros(4)]),
    "contact_force": np.tile([0.0, 0.0, WEIGHT / 4], (4, 1)),
    "contact_touched": np.ones(4, bool),
    "motor_torque": np.full(10, -3.0),
    "motor_speed": np.full(10, 2.0),
    "base_angular_velocity": np.zeros(3),
    "ground_height": np.zeros(4),
}
IN_AIR: Fields = {
    **ON_GROUND,
    "contact_position": np.column_stack([FEET, np.full(4, 0.05)]),
    "contact_force": np.zeros((4, 3)),
    "contact_touched": np.zeros(4, bool),
}


def perfect(time: float) -> Fields:
    """The truth of a perfect jump on the spot."""
    height, speed = com_of(time)
    air = in_air(time)
    return {
        **{name: value.copy() for name, value in (IN_AIR if air else ON_GROUND).items()},
        "base_position": [0.0, 0.0, height + 0.05],
        "base_orientation": LEAN,
        "com": [0.0, 0.0, height],
        "com_velocity": [0.0, 0.0, speed],
        "angular_momentum": [0.0, time, 0.0] if time < LIFT_OFF else [0.03, -0.04, 0.0],
        "saturated_share": 0.25 if air else 0.0,
        "forbidden_contacts": 0,
        "joint_limit_violation": 0.0,
        "motor_overload": 0.0,
    }


def plan(time: float) -> Fields:
    """The reference of that jump."""
    height, speed = com_of(time)
    return {
        "time": time, "lift_off_time": LIFT_OFF, "touchdown_time": TOUCHDOWN,
        "com": [0.0, 0.0, height], "com_velocity": [0.0, 0.0, speed],
        "foot_position": [[0.0, -0.076, 0.0], [0.0, 0.076, 0.0]],
    }  # fmt: skip


def run(
    change: Callable[[float, Fields], None] = lambda time, truth: None,
    change_plan: Callable[[float, Fields], None] = lambda time, plan: None,
    *,
    until: float = 10.0,
    wired: tuple[str, ...] = ("truth", "reference", "wbc"),
    **params: Any,
) -> tuple[Mapping[str, Any], BlockBench[JumpScore]]:
    bench = BlockBench(JumpScore, params, robot="bruce", rate=1 / PERIOD, wired=wired)
    while bench.stop_reason is None and bench.clock.tick * PERIOD < until:
        time = bench.clock.tick * PERIOD
        truth, reference = perfect(time), plan(time)
        change(time, truth)
        change_plan(time, reference)
        bench.set("truth", **truth)
        if "reference" in wired:
            bench.set("reference", **reference)
        if "wbc" in wired:
            bench.set("wbc", failures=3)
        bench.step()
    return bench.block.metrics(), bench


def test_a_perfect_jump_succeeds_with_the_right_figures() -> None:
    metrics, bench = run()
    assert metrics["success"] is True and metrics["reason"] == "all criteria hold"
    rise = SPEED**2 / 2 / 9.81
    assert metrics["apex_above_standing_m"] == pytest.approx(rise, abs=1e-4)
    assert metrics["apex_from_squat_m"] == pytest.approx(rise + 0.08, abs=1e-4)
    assert metrics["lift_off_speed_m_s"] == pytest.approx(SPEED, abs=1e-9)
    assert metrics["lift_off_angular_momentum_nms"] == pytest.approx(0.05)
    assert metrics["lift_off_pitch_momentum_nms"] == pytest.approx(-0.04)
    assert metrics["touchdown_speed_m_s"] == pytest.approx(SPEED, abs=0.03)
    assert metrics["flight_time_s"] == pytest.approx(TOUCHDOWN - LIFT_OFF, abs=PERIOD)
    assert metrics["planned_flight_time_s"] == pytest.approx(TOUCHDOWN - LIFT_OFF)
    assert metrics["planned_lift_off_speed_m_s"] == pytest.approx(SPEED)
    assert metrics["planned_apex_above_standing_m"] == pytest.approx(rise, abs=1e-4)
    assert metrics["peak_tilt_deg"] == pytest.approx(math.degrees(0.01))
    assert metrics["final_tilt_deg"] == pytest.approx(math.degrees(0.01))
    assert metrics["final_support_margin_m"] == pytest.approx(0.0425)
    assert metrics["final_load_share"] == pytest.approx(0.5)
    assert metrics["foot_slip_m"] == 0.0 and metrics["final_com_speed_m_s"] == 0.0
    assert metrics["peak_motor_torque_nm"] == 3.0 and metrics["peak_motor_speed_rad_s"] == 2.0
    assert metrics["qp_failures"] == 3
    ticks = bench.clock.tick
    assert metrics["saturated_share"] == pytest.approx(0.25 * 122 / ticks, rel=0.02)
    assert metrics["jump_distance_x_m"] == 0.0 and metrics["jump_yaw_deg"] == 0.0
    assert bench.clock.tick * PERIOD == pytest.approx(TOUCHDOWN + 1.6, abs=2 * PERIOD)
    assert "after touchdown" in str(bench.stop_reason)


def after(start: float, **fields: Any) -> Callable[[float, Fields], None]:
    """Replace fields of the truth from ``start`` seconds after touchdown on."""

    def change(time: float, truth: Fields) -> None:
        if time >= TOUCHDOWN + start:
            truth.update(fields)

    return change


def at(instant: float, **fields: Any) -> Callable[[float, Fields], None]:
    """Replace fields of the truth in the one tick at ``instant``."""

    def change(time: float, truth: Fields) -> None:
        if abs(time - instant) < PERIOD / 2:
            truth.update(fields)

    return change


def moved(x: float, y: float, turn: float = 0.0) -> np.ndarray:
    """The contact points after a jump by (x, y) and a turn to the left."""
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    return np.column_stack([FEET @ rotation.T + [x, y], np.zeros(4)])


def scaled_flight(factor: float) -> Callable[[float, Fields], None]:
    """A flight that ends after ``factor`` of the planned time."""

    def change(time: float, truth: Fields) -> None:
        if time >= LIFT_OFF + factor * (TOUCHDOWN - LIFT_OFF):
            truth["contact_touched"] = np.full(4, True)

    return change


def faster_lift_off(time: float, truth: Fields) -> None:
    if abs(time - LIFT_OFF) < PERIOD / 2:
        truth["com_velocity"] = [0.0, 0.0, 1.15 * SPEED]


def higher(time: float, truth: Fields) -> None:
    if in_air(time):
        truth["com"] = [0.0, 0.0, STANDING + (com_of(time)[0] - STANDING) * 1.15]


def lifted_foot(time: float, truth: Fields) -> None:
    if TOUCHDOWN + 0.5 < time < TOUCHDOWN + 0.53:
        truth["contact_touched"] = [True, True, False, False]


CASES: dict[str, tuple[Callable[[float, Fields], None], str]] = {
    "knee": (at(0.7, forbidden_contacts=2), r"other than the contact points touched, first at 0.700 s, in 2 "),
    "tilt": (at(1.5, base_orientation=quaternion(1.3)), r"^fell at 1.500 s: tilt 74.5 deg"),
    "low": (at(0.8, base_position=[0, 0, 0.11]), r"^fell at 0.800 s: .* base 0.110 m"),
    "flight": (scaled_flight(0.85), r"^flight of 0.20\d s is below 90% of the planned 0.245 s"),
    "speed": (faster_lift_off, r"^lift-off at 1.380 m/s is not within 10% of the planned 1.200"),
    "limit": (at(0.7, joint_limit_violation=0.01), r"^a joint went 0.0100 rad over its limit"),
    "motor": (at(0.7, motor_overload=0.2), r"^a motor gave 0.2 N m more than its speed allows"),
    "peak": (at(1.5, base_orientation=quaternion(0.3)), r"^tilted by 17.2 deg after touchdown"),
    "final tilt": (after(0.1, base_orientation=quaternion(0.1, 0)), r"^tilt at rest 5.73 deg"),
    "speed at rest": (after(1.4, com_velocity=[0.06, 0, 0]), r"^centre of mass at rest moves at 0.060"),
    "turning": (after(1.4, base_angular_velocity=[0, 0, 0.3]), r"^base at rest turns at 0.300 rad/s"),
    "heel": (after(1.4, contact_touched=[True, False, True, True]), r"^1 contact points carry no load"),
    "load": (
        after(1.4, contact_force=np.array([[0, 0, 1.0], [0, 0, 1.0], [0, 0, 24.0], [0, 0, 24.0]])),
        r"^a foot carries 4% of the weight at rest, limit 20%",
    ),
    "margin": (after(1.4, com=[0.035, 0.0, 0.32]), r"^centre of mass 7.5 mm inside the support"),
    "step": (lifted_foot, r"^stepped: a foot was off the ground for 0.03\d s after landing"),
    "slip": (after(0.6, contact_position=moved(0.006, 0.0)), r"^feet slid 6.0 mm after landing"),
    "apex": (higher, r"^rose 84.\d mm above standing, not within 10% of 73.4 mm"),
    "place": (after(0.0, contact_position=moved(0.03, 0.0), com=[0.03, 0, 0.32]),
              r"^jumped \(30.0, 0.0\) mm, not within 20 mm of \(0.0, 0.0\) mm"),
    "turn": (after(0.0, contact_position=moved(0.0, 0.0, 0.1)), r"^turned 5.7 deg, not within 5.0 deg"),
    "ground": (after(0.0, ground_height=[0.0, -0.1, 0.0, 0.0]), r"ended above ground at -0.100 to 0.000 m"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_each_criterion_can_fail_alone(name: str) -> None:
    change, reason = CASES[name]
    metrics, _ = run(change)
    assert metrics["success"] is False
    assert re.search(reason, str(metrics["reason"])), metrics["reason"]


def test_a_fall_ends_the_run() -> None:
    _, bench = run(at(0.8, base_position=[0.0, 0.0, 0.1]))
    assert bench.stop_reason == "the robot fell"
    assert bench.clock.tick == 401


def test_runs_that_end_too_early() -> None:
    assert run(until=0.9)[0]["reason"] == "never left the ground for 0.02 s"
    assert "no touchdown before the run ended at 1.09" in str(run(until=1.1)[0]["reason"])
    early, _ = run(until=2.0)
    assert early["success"] is False
    assert "s after touchdown, before 1.5 s" in str(early["reason"])
    assert "final_tilt_deg" not in early and "peak_tilt_deg" in early
    bench = BlockBench(JumpScore, {}, robot="bruce")
    assert bench.block.metrics()["reason"] == "the run had no ticks"


def test_a_short_hop_is_no_flight() -> None:
    def bounce(time: float, truth: Fields) -> None:
        if 0.3 < time < 0.315:
            truth["contact_touched"] = np.full(4, False)

    metrics, _ = run(bounce)
    assert metrics["success"] is True
    assert metrics["flight_time_s"] == pytest.approx(TOUCHDOWN - LIFT_OFF, abs=PERIOD)


def test_on_uneven_ground_the_robot_is_judged_by_what_it_does() -> None:
    change = after(0.0, ground_height=[0.0, 0.004, -0.003, 0.0],
                   contact_touched=[True, False, False, True])  # fmt: skip
    level, _ = run(change)
    assert "contact points carry no load" in str(level["reason"])
    uneven, _ = run(change, ground_tolerance=0.005)
    assert uneven["success"] is True, uneven["reason"]
    lower, _ = run(change, ground_tolerance=0.003)
    assert "not all at 0.000 m within 3 mm" in str(lower["reason"])


def test_targets_given_as_parameters_win_over_the_reference() -> None:
    change = after(0.0, contact_position=moved(0.1, 0.0, 0.5), com=[0.1, 0.0, 0.32],
                   ground_height=[0.05] * 4, base_position=[0.1, 0.0, 0.4])  # fmt: skip
    good = {"distance": [0.1, 0.0], "yaw": 0.5, "landing_height": 0.05}
    metrics, _ = run(change, **good)
    assert metrics["success"] is True, metrics["reason"]
    assert metrics["jump_distance_x_m"] == pytest.approx(0.1)
    assert metrics["jump_yaw_deg"] == pytest.approx(math.degrees(0.5))
    for name, value, reason in (
        ("distance", [0.13, 0.0], "jumped"), ("yaw", 0.4, "turned"), ("rise", 0.06, "rose"),
        ("landing_height", 0.08, "contact points ended"),
    ):  # fmt: skip
        assert str(run(change, **{**good, name: value})[0]["reason"]).startswith(reason)


def test_targets_of_the_reference() -> None:
    def forward(time: float, reference: Fields) -> None:
        if time > LIFT_OFF:
            reference["foot_position"] = [[0.1, -0.076, 0.0], [0.1, 0.076, 0.0]]
            reference["foot_yaw"] = [0.5, 0.5]

    change = after(0.0, contact_position=moved(0.1, 0.0, 0.5), com=[0.1, 0.0, 0.32])
    assert run(change, forward)[0]["success"] is True
    assert "jumped (0.0, 0.0) mm" in str(run(change_plan=forward)[0]["reason"])


def test_the_planned_rise_is_above_the_plans_own_standing_height() -> None:
    def raised(time: float, reference: Fields) -> None:
        x, y, z = reference["com"]
        reference["com"] = [x, y, z + 0.02]  # the plan's model has its com elsewhere

    assert run(change_plan=raised)[0]["success"] is True


def test_without_a_reference_only_what_is_given_is_judged() -> None:
    metrics, _ = run(faster_lift_off, wired=("truth",))
    assert metrics["success"] is True and "planned_flight_time_s" not in metrics
    assert metrics["qp_failures"] == 0
    metrics, _ = run(higher, wired=("truth",), rise=0.0734)
    assert str(metrics["reason"]).startswith("rose")


def test_tolerances_are_parameters() -> None:
    change, _ = CASES["slip"]
    assert run(change, foot_slip="20 mm")[0]["success"] is True
    change, _ = CASES["peak"]
    assert run(change, peak_tilt="45 deg")[0]["success"] is True


def test_a_robot_is_needed() -> None:
    dimensions = {"n_joints": 10, "n_velocities": 16, "n_contacts": 4, "n_feet": 2}
    with pytest.raises(BlockError, match="it needs a robot, and the graph names none"):
        BlockBench(JumpScore, {}, dimensions=dimensions)


def stepping(number: int) -> Callable[[float, Fields], None]:
    """The feet step back by 15 mm in turn, left first, ``number`` times."""

    def change(time: float, truth: Fields) -> None:
        place = np.column_stack([FEET, np.zeros(4)])
        touched = np.full(4, True)
        for step in range(number):
            begin = TOUCHDOWN + 0.4 + 0.2 * step
            points = slice(2, 4) if step % 2 == 0 else slice(0, 2)
            if time > begin:
                place[points, 0] -= 0.015 * min((time - begin) / 0.1, 1.0)
                touched[points] = touched[points] & (time > begin + 0.1)
        if time > TOUCHDOWN:
            truth["contact_position"], truth["contact_touched"] = place, touched

    return change


def test_steps_are_allowed_and_the_rest_is_judged_after_them() -> None:
    metrics, _ = run(stepping(2), steps=2, distance_tolerance=0.04)
    assert metrics["success"] is True, metrics["reason"]
    assert metrics["steps"] == 2 and metrics["foot_slip_m"] < 1e-3
    _, bench = run(stepping(2), steps=2, distance_tolerance=0.04)
    ended = TOUCHDOWN + 0.7
    assert bench.clock.tick * PERIOD == pytest.approx(ended + 1.6, abs=0.01)


def test_more_steps_than_allowed_fail() -> None:
    metrics, _ = run(stepping(3), steps=2, distance_tolerance=0.1)
    assert metrics["success"] is False and metrics["reason"].startswith("stepped: a foot was off")


def test_a_foot_that_slides_after_its_step_fails() -> None:
    def change(time: float, truth: Fields) -> None:
        stepping(1)(time, truth)
        if time > TOUCHDOWN + 1.0:
            truth["contact_position"] = truth["contact_position"] + [0.007, 0.0, 0.0]

    metrics, _ = run(change, steps=2, distance_tolerance=0.04)
    assert metrics["success"] is False and metrics["reason"].startswith("feet slid 7.0 mm")


# A row of jumps

JUMPS = 3
FLIGHT, EVERY, STRIDE = 2 * SPEED / 9.81, 0.55, 0.1
LIFT_OFFS = [1.0 + EVERY * k for k in range(JUMPS)]


def row_state(time: float) -> tuple[int, float, float]:
    """How many jumps have begun, time since the last lift-off, and the feet's x."""
    begun = sum(time >= start - 1e-9 for start in LIFT_OFFS)
    flown = time - LIFT_OFFS[begun - 1] if begun else 0.0
    return begun, flown, STRIDE * (begun - 1 + min(1.0, flown / FLIGHT)) if begun else 0.0


def row_motion(time: float) -> tuple[float, float]:
    """Height and vertical speed of the centre of mass, forced up just before every lift-off."""
    begun, flown, _ = row_state(time)
    if begun and flown < FLIGHT:
        return STANDING + SPEED * flown - 9.81 / 2 * flown**2, SPEED - 9.81 * flown
    soon = any(start - 0.01 <= time < start for start in LIFT_OFFS)
    return STANDING, SPEED if soon else 0.0


def truth_at(time: float) -> Fields:
    begun, flown, x = row_state(time)
    # The tick that ends at lift-off is spent on the ground, that of the touchdown in the air.
    air = bool(begun) and PERIOD - 1e-9 <= flown < FLIGHT
    height, speed = row_motion(time)
    feet = FEET + np.array([x, 0.0])
    return {
        "base_position": [x, 0.0, height + 0.05], "base_orientation": [0.0, 0.0, 0.0, 1.0],
        "com": [x, 0.0, height], "com_velocity": [0.0, 0.0, speed],
        "contact_position": np.column_stack([feet, np.full(4, 0.05 if air else 0.0)]),
        "contact_force": np.tile([0.0, 0.0, 0.0 if air else WEIGHT / 4], (4, 1)),
        "contact_touched": np.full(4, not air), "ground_height": np.zeros(4),
    }  # fmt: skip


def plan_at(time: float) -> Fields:
    """The reference names the next jump from the middle of a flight on."""
    begun, _, x = row_state(time)
    height, speed = row_motion(time)
    number = max(0, begun - 1)
    if begun and begun < JUMPS and time >= LIFT_OFFS[number] + FLIGHT / 2:
        number += 1
    return {
        "time": time, "lift_off_time": LIFT_OFFS[number],
        "touchdown_time": LIFT_OFFS[number] + FLIGHT,
        "com": [x, 0.0, height], "com_velocity": [0.0, 0.0, speed],
        "foot_position": [[x, -0.076, 0.0], [x, 0.076, 0.0]],
    }  # fmt: skip


def bench_of(change: Change, plain: bool, **params: Any) -> BlockBench[JumpScore]:
    """The judge after all that it watches."""
    wired = ("truth", "reference")
    values = {"jumps": JUMPS} | params
    bench = BlockBench(JumpScore, values, robot="bruce", rate=1 / PERIOD, wired=wired, plain=plain)
    while bench.stop_reason is None and bench.clock.tick * PERIOD < 8.0:
        time = bench.clock.tick * PERIOD
        truth = truth_at(time)
        change(time, truth)
        bench.set("truth", **truth)
        bench.set("reference", **plan_at(time))
        bench.step()
    return bench


def run_row(
    change: Change = lambda time, truth: None, **params: Any
) -> tuple[Mapping[str, Any], str]:
    bench = bench_of(change, False, **params)
    return bench.block.metrics(), str(bench.stop_reason)


def test_a_perfect_row_succeeds() -> None:
    metrics, stopped = run_row()
    assert metrics["reason"] == "all criteria hold"
    assert metrics["jumps"] == JUMPS
    assert metrics["jump_distance_x_m"] == pytest.approx(JUMPS * STRIDE)
    assert metrics["worst_landing_error_m"] == pytest.approx(0.0, abs=1e-9)
    assert metrics["planned_flight_time_s"] == pytest.approx(FLIGHT)
    assert stopped == "1.60 s after touchdown"


def test_the_row_ends_with_its_last_jump() -> None:
    metrics, stopped = run_row(jumps=2)
    assert metrics["success"] is False, "it went on jumping"
    assert metrics["jumps"] == 2
    metrics, stopped = run_row(jumps=4)
    assert metrics["reason"] == "made 3 of 4 jumps"
    assert stopped == "no other jump 1.50 s after touchdown"


def test_machine_code_follows_a_row_as_plain_python_does() -> None:
    """Every byte of what is kept is the same, with steps, slides and a fall at the end."""

    def change(time: float, truth: Fields) -> None:
        astray(time, truth)
        if time > LIFT_OFFS[-1] + FLIGHT + 0.3:
            truth["contact_touched"] = np.array([time % 0.3 > 0.05] * 2 + [True] * 2)
            truth["contact_position"] = truth["contact_position"] + [0.01 * time, 0.003, 0.0]
        if time > LIFT_OFFS[-1] + FLIGHT + 1.0:
            truth["base_position"] = [0.0, 0.0, 0.05]

    benches = [bench_of(change, plain, steps=2) for plain in (True, False)]
    assert benches[0].stop_reason == benches[1].stop_reason == "the robot fell"
    kept = [bench.snapshot() for bench in benches]
    assert kept[0] == kept[1]
    assert benches[0].block.metrics() == benches[1].block.metrics()


def within(start: float, end: float) -> Callable[[float], bool]:
    return lambda time: start <= time < end


SECOND = within(LIFT_OFFS[1], LIFT_OFFS[1] + FLIGHT)


def low(time: float, truth: Fields) -> None:
    if SECOND(time) and truth["com"][2] > STANDING + 0.05:
        truth["com"] = [0.0, 0.0, STANDING + 0.05]


def short(time: float, truth: Fields) -> None:
    if within(LIFT_OFFS[1] + 0.15, LIFT_OFFS[1] + FLIGHT)(time):
        truth["contact_touched"] = np.full(4, True)


def slow(time: float, truth: Fields) -> None:
    if within(LIFT_OFFS[1] - 0.01, LIFT_OFFS[1] + 0.004)(time):
        truth["com_velocity"] = [0.0, 0.0, 0.8 * SPEED]


def astray(time: float, truth: Fields) -> None:
    if within(LIFT_OFFS[0] + FLIGHT, LIFT_OFFS[1] + 0.02)(time):
        truth["contact_position"] = truth["contact_position"] + [0.0, 0.04, 0.0]


def askew(time: float, truth: Fields) -> None:
    if within(LIFT_OFFS[0] + FLIGHT, LIFT_OFFS[1] + 0.02)(time):
        shift = np.array([[0.0, 0.005, 0.0], [0.0, -0.005, 0.0]] * 2)
        truth["contact_position"] = truth["contact_position"] + shift


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (low, "jump 2: apex 32% off the planned rise, limit 10%"),
        (short, "jump 2: flight of 60% of the planned one, below 90%"),
        (slow, "jump 2: lift-off speed 20% off the plan, limit 10%"),
        (astray, "jump 1: landed 40.0 mm from its place, limit 30 mm"),
        (askew, "jump 1: landed 6.7 deg off its heading, limit 5 deg"),
    ],
)
def test_each_jump_is_judged(change: Callable[[float, Fields], None], words: str) -> None:
    metrics, _ = run_row(change)
    assert metrics["reason"] == words
    assert metrics["success"] is False


@pytest.mark.parametrize(
    ("change", "too_little", "words", "enough"),
    [
        (low, 0.015, "jump 2: apex 11% off the planned rise, limit 10%", 0.017),
        (short, 0.04, "jump 2: flight of 88% of the planned one, below 90%", 0.046),
    ],
)
def test_on_uneven_ground_a_row_lifts_off_and_lands_higher_or_lower(
    change: Callable[[float, Fields], None], too_little: float, words: str, enough: float
) -> None:
    assert run_row(change, ground_tolerance=too_little)[0]["reason"] == words
    assert run_row(change, ground_tolerance=enough)[0]["success"] is True


def test_a_bounce_is_no_jump() -> None:
    landed = LIFT_OFFS[0] + FLIGHT

    def bounce(time: float, truth: Fields) -> None:
        if within(landed + 0.02, landed + 0.06)(time):
            truth["contact_touched"] = np.full(4, False)

    assert run_row(bounce)[0]["reason"] == "all criteria hold"


def test_a_fall_comes_before_all_else() -> None:
    def fall(time: float, truth: Fields) -> None:
        if time > LIFT_OFFS[1] + FLIGHT + 0.1:
            truth["base_position"] = [0.0, 0.0, 0.05]

    metrics, stopped = run_row(fall)
    assert metrics["reason"].startswith("fell at ")
    assert metrics["jumps"] == 2
    assert stopped == "the robot fell"
