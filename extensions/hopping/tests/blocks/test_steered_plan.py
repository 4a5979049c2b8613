"""``SteeredPlan`` asks from where the feet are, begins a whole plan when it rests, and moves its frame."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from aloft.blocks.signals import Phase
from aloft.extensions.hopping.blocks.steered_plan import SteeredPlan
from aloft.extensions.hopping.planner.hop_plans import hop_table, samples_of_hops
from aloft.extensions.hopping.planner.plan_outcome import PlanOutcome
from aloft.extensions.hopping.signals import SEGMENT_ROWS
from aloft.planner.library.jump_table import table_rows
from aloft.robots.description import find_robot
from aloft.robots.kinematics import standing_feet
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")


def at(
    bench: BlockBench[SteeredPlan],
    x: float,
    y: float,
    heading: float,
    phase: Phase,
    off: float = 0.0,
    **more: float,
) -> None:
    """Let the feet be there, and the centre of mass ``off`` ahead of them."""
    cosine, sine = math.cos(heading), math.sin(heading)
    turn = [[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]
    feet = [[x + side * sine * 0.07, y - side * cosine * 0.07, 0.0] for side in (1.0, -1.0)]
    com = [x + off, y, 0.32]
    bench.set("terms", foot_position=feet, foot_rotation=[turn, turn], com=com)
    bench.set("phase", phase=phase, **more)


def hand_over(
    bench: BlockBench[SteeredPlan], number: int, outcome: PlanOutcome, row: int = 0
) -> None:
    """Give all parts of a stored plan."""
    samples = samples_of_hops(find_robot("bruce"))
    table = hop_table(samples.plan(row), ROBOT)
    rows, n = table_rows(table).rows, len(table.time)
    parts = -(-n // SEGMENT_ROWS)
    ahead, aside, turn, up = samples.requests[row]
    for part in range(parts):
        pick = np.minimum(np.arange(part * SEGMENT_ROWS, (part + 1) * SEGMENT_ROWS), n - 1)
        bench.set(
            "segment", number=number, segment=part, segments=parts, time=table.time[pick], rows=rows[pick],
            contact=table.contact[pick], marks=[table.squat_time, table.recover_time],
            jump=[table.thrust_time, table.lift_off_time, table.touchdown_time],
            outcome=outcome, ahead=ahead, aside=aside, turn=turn, up=up,
        )  # fmt: skip
        bench.step()


def standing(heading: float = 0.0) -> BlockBench[SteeredPlan]:
    bench = BlockBench(SteeredPlan, {"settle_time": 0.01}, robot="bruce")
    for _ in range(8):
        at(bench, 0.0, 0.0, heading, Phase.STAND)
        bench.step()
    return bench


def test_it_stands_until_a_plan_has_come() -> None:
    bench = standing()
    reference = bench.get("reference")
    assert int(reference.phase) == Phase.STAND
    assert reference.lift_off_time > 1e5
    assert np.asarray(reference.com)[2] == pytest.approx(0.32, abs=0.02)
    assert bench.get("request").number == 0


def test_the_next_request_corrects_where_it_has_landed() -> None:
    bench = standing()
    bench.set("command", number=1, ahead=0.2, aside=0.0, turn=0.0)
    bench.step()
    request = bench.get("request")
    assert int(request.number) == 1
    assert float(request.ahead) == pytest.approx(0.2)
    hand_over(bench, 1, PlanOutcome.PLANNED)
    assert int(bench.get("goal").number) == 1
    assert int(bench.get("reference").phase) == Phase.SQUAT
    # It lands 3 cm short, and a little to the left; the next command is another 10 cm. A half of the error, but no more
    # than 1 cm, is taken for the robot's own.
    at(bench, 0.17, 0.01, 0.0, Phase.LANDING, time_since_touchdown=0.1)
    bench.set("command", number=2, ahead=0.1, aside=0.0, turn=0.0)
    bench.step()
    assert int(request.number) == 1, "it asks only when the feet have come to rest"
    bench.set("phase", time_since_touchdown=0.16)
    bench.step()
    assert int(request.number) == 2
    assert [float(request.ahead), float(request.aside)] == pytest.approx([0.14, -0.015])
    assert np.asarray(bench.get("goal").position) == pytest.approx([0.3, 0.0])


def test_places_and_heights_are_those_of_the_commands() -> None:
    bench = standing()
    request, goal = bench.get("request"), bench.get("goal")
    bench.set("command", number=1, placed=True, ahead=0.25, aside=0.05, turn=0.1, up=0.04)
    bench.step()
    asked = [float(getattr(request, name)) for name in ("ahead", "aside", "turn", "up")]
    assert asked == pytest.approx([0.25, 0.05, 0.1, 0.04])
    hand_over(bench, 1, PlanOutcome.PLANNED)
    assert float(goal.height) == pytest.approx(0.04)
    # The next place is 1 cm lower than this one; where the feet are said to be does not count.
    at(bench, 0.25, 0.05, 0.1, Phase.LANDING, time_since_touchdown=0.2)
    bench.set("command", number=2, placed=True, ahead=0.5, aside=0.05, turn=0.1, up=0.03)
    bench.step()
    assert int(request.number) == 2
    assert float(request.up) == pytest.approx(-0.01)
    assert np.asarray(goal.position) == pytest.approx([0.5, 0.05])


def test_a_command_replaces_one_whose_jump_has_not_begun() -> None:
    bench = standing()
    request, goal = bench.get("request"), bench.get("goal")
    bench.set("command", number=1, ahead=0.2, up=0.04)
    bench.step()
    assert bool(request.waits)
    bench.set("command", number=2, ahead=0.0, aside=0.1, up=0.0)
    bench.step()
    assert int(request.number) == 1, "it waits for the jump before it"
    bench.set("command", number=2, replaces=True)
    bench.step()
    assert int(request.number) == 2 and int(request.command) == 2
    assert [float(request.ahead), float(request.aside)] == pytest.approx([0.0, 0.1])
    assert float(request.up) == 0.0
    assert np.asarray(goal.position) == pytest.approx([0.0, 0.1])
    hand_over(bench, 1, PlanOutcome.PLANNED)
    assert int(goal.number) == 0, "the plan of the first is not followed"
    hand_over(bench, 2, PlanOutcome.PLANNED)
    assert int(goal.number) == 1 and not bool(request.waits)


def test_a_robot_that_always_lands_too_far_learns_to_aim_shorter() -> None:
    bench = standing()
    place = 0.0
    errors = []
    for number in range(1, 9):
        bench.set("command", number=number, ahead=0.2)
        bench.step()
        hand_over(bench, number, PlanOutcome.PLANNED)
        place += float(bench.get("request").ahead) + 0.01  # it goes 1 cm further than asked
        errors.append(place - float(np.asarray(bench.get("goal").position)[0]))
        origin = float(np.asarray(bench.get("frame").origin)[0])
        at(bench, place - origin, 0.0, 0.0, Phase.LANDING, time_since_touchdown=0.2)
        bench.set("phase", phase=Phase.STAND)
    assert errors[0] == pytest.approx(0.01)
    assert abs(errors[-1]) < 1e-3


def test_a_plan_begins_when_the_robot_rests_and_moves_the_frame() -> None:
    bench = standing()
    bench.set("command", number=1, ahead=0.2, aside=0.0, turn=0.5)
    at(bench, 0.1, 0.2, 0.3, Phase.RECOVER, time_in_phase=0.1)
    bench.step()
    hand_over(bench, 1, PlanOutcome.PLANNED)
    assert int(bench.get("goal").number) == 0
    bench.set("phase", time_in_phase=0.7)
    bench.step()
    assert int(bench.get("goal").number) == 1
    frame = bench.get("frame")
    assert np.asarray(frame.origin) == pytest.approx([0.1, 0.2, 0.0])
    assert float(frame.heading) == pytest.approx(0.3)
    # From the next tick on the feet are told in that frame, and nothing else begins.
    at(bench, 0.0, 0.0, 0.0, Phase.RECOVER, time_in_phase=0.702)
    bench.step()
    assert float(frame.heading) == pytest.approx(0.3)
    assert float(bench.get("goal").heading) == pytest.approx(0.5)


def test_a_plan_waits_until_the_capture_point_is_where_it_begins() -> None:
    bench = standing()
    bench.set("command", number=1, ahead=0.2)
    bench.step()
    hand_over(bench, 1, PlanOutcome.PLANNED)
    bench.set("command", number=2, ahead=0.1)
    at(bench, 0.2, 0.0, 0.0, Phase.LANDING, time_since_touchdown=0.2)
    bench.step()
    at(bench, 0.2, 0.0, 0.0, Phase.RECOVER, off=-0.034, time_in_phase=0.4)
    hand_over(bench, 2, PlanOutcome.PLANNED)
    assert int(bench.get("goal").number) == 1, "its centre of mass is still over the heels"
    at(bench, 0.2, 0.0, 0.0, Phase.RECOVER, off=-0.034, time_in_phase=0.5)
    bench.set("terms", com_velocity=[0.19, 0.0, 0.0])  # 0.034 m times the pendulum's 5.5 1/s
    bench.step()
    assert int(bench.get("goal").number) == 2


def test_a_robot_that_never_rests_begins_after_the_limit() -> None:
    bench = standing()
    bench.set("command", number=1, ahead=0.2)
    at(bench, 0.0, 0.0, 0.0, Phase.RECOVER, off=-0.034, time_in_phase=0.1)
    bench.step()
    hand_over(bench, 1, PlanOutcome.PLANNED)
    bench.set("phase", time_in_phase=2.29)
    bench.step()
    assert int(bench.get("goal").number) == 0
    bench.set("phase", time_in_phase=2.31)
    bench.step()
    assert int(bench.get("goal").number) == 1


def test_a_step_after_the_request_has_the_jump_asked_for_anew() -> None:
    bench = standing()
    request, goal = bench.get("request"), bench.get("goal")
    bench.set("command", number=1, ahead=0.2)
    bench.step()
    hand_over(bench, 1, PlanOutcome.PLANNED)
    at(bench, 0.2, 0.0, 0.0, Phase.LANDING, time_since_touchdown=0.2)
    bench.set("command", number=2, ahead=0.1)
    bench.step()
    assert float(request.ahead) == pytest.approx(0.1)
    at(bench, 0.195, 0.0, 0.02, Phase.RECOVER, time_in_phase=0.1)
    bench.step()
    assert int(request.number) == 2, "what feet settle by is nothing"
    at(bench, 0.14, 0.03, 0.1, Phase.RECOVER, time_in_phase=0.1)
    bench.step()
    assert int(request.number) == 3
    cosine, sine = math.cos(0.1), math.sin(0.1)
    way = [cosine * 0.16 - sine * 0.03, -sine * 0.16 - cosine * 0.03, -0.1]
    asked = [float(request.ahead), float(request.aside), float(request.turn)]
    assert asked == pytest.approx(way)
    assert np.asarray(goal.position) == pytest.approx([0.3, 0.0]), "the goal stays"
    hand_over(bench, 2, PlanOutcome.PLANNED)
    bench.set("phase", time_in_phase=0.5)
    bench.step()
    assert int(goal.number) == 1, "the plan from the old place is not followed"


def test_what_cannot_be_done_moves_the_goal_to_what_is_done() -> None:
    bench = standing()
    bench.set("command", number=1, ahead=0.9, aside=0.0, turn=0.0)
    bench.step()
    hand_over(bench, 1, PlanOutcome.UNSOLVED, row=1)
    ahead, aside, turn, _ = samples_of_hops(find_robot("bruce")).requests[1]
    goal = bench.get("goal")
    assert np.asarray(goal.position) == pytest.approx([ahead, aside])
    assert float(goal.heading) == pytest.approx(turn)
    assert int(goal.outcome) == PlanOutcome.UNSOLVED


@pytest.mark.parametrize("heading", [0.0, 0.4, -2.0])
def test_point_feet_give_the_direction_together(heading: float) -> None:
    robot = find_robot("go2")
    bench = BlockBench(SteeredPlan, {"settle_time": 0.01}, robot="go2")
    cosine, sine = math.cos(heading), math.sin(heading)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    feet = standing_feet(robot)
    # How the links of the calves are turned says nothing.
    bench.set("terms", foot_position=feet @ turn.T, foot_rotation=np.tile(np.eye(3), (4, 1, 1)))
    bench.set("phase", phase=Phase.STAND)
    for _ in range(8):
        bench.step()
    bench.set("command", number=1, placed=True, ahead=0.3, aside=0.1, turn=0.0, up=0.0)
    bench.step()
    request = bench.get("request")
    middle = (feet @ turn.T).mean(axis=0)
    way = turn.T @ ([0.3, 0.1, 0.0] - middle)
    assert [request.ahead, request.aside] == pytest.approx(way[:2].tolist())
    assert float(request.turn) == pytest.approx(-heading)


def test_a_robot_without_stored_plans_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))  # where a user's own plans are kept
    with pytest.raises(BlockError, match="no stored plans of hops for a1"):
        BlockBench(SteeredPlan, robot="a1")


def thrusting(left: float) -> BlockBench[SteeredPlan]:
    """A jump that was asked to go 15 cm ahead is under way, so long before its lift-off [s]."""
    bench = standing()
    bench.set("command", number=1, ahead=0.15)
    bench.step()
    hand_over(bench, 1, PlanOutcome.PLANNED)
    reference = bench.get("reference")
    for _ in range(1000):
        if reference.lift_off_time - reference.time <= left:
            return bench
        bench.set("phase", phase=Phase(int(reference.phase)))
        bench.step()
    raise AssertionError("it never lifts off")


def touchdown_of(bench: BlockBench[SteeredPlan]) -> tuple[np.ndarray, np.ndarray]:
    """Centre of mass and soles at the planned touchdown."""
    reference = bench.get("reference")
    for _ in range(400):
        if reference.time >= reference.touchdown_time - 0.003:
            break
        bench.set("phase", phase=Phase(int(reference.phase)))
        bench.step()
    return np.array(reference.com), np.array(reference.foot_position)


def test_a_landing_moves_until_100_ms_before_lift_off() -> None:
    unmoved = touchdown_of(thrusting(0.12))
    bench = thrusting(0.12)
    goal, com = bench.get("goal"), np.array(bench.get("reference").com)
    bench.set("command", number=2, ahead=0.17, aside=0.03, replaces=True)
    bench.step()
    assert int(bench.get("request").number) == 1, "no new plan is asked for"
    assert int(bench.get("request").command) == 2
    assert int(goal.outcome) == PlanOutcome.PLANNED
    assert np.asarray(goal.position) == pytest.approx([0.17, 0.03])
    assert np.asarray(bench.get("reference").com) == pytest.approx(com, abs=3e-3), "no jump"
    moved = touchdown_of(bench)
    assert (moved[0] - unmoved[0])[:2] == pytest.approx([0.02, 0.03], abs=1e-3)
    assert (moved[1] - unmoved[1])[:, :2] == pytest.approx(np.array([[0.02, 0.03]] * 2), abs=1e-3)
    assert (moved[0] - unmoved[0])[2] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("asked", "done"),
    [
        ({"ahead": 0.30}, [0.20, 0.0, 0.0, 0.0]),  # the limit
        ({"ahead": 0.05}, [0.15 - 0.0244, 0.0, 0.0, 0.0]),  # the braking that is left
        ({"ahead": 0.15, "turn": 0.5}, [0.15, 0.0, 0.35, 0.0]),
        ({"ahead": 0.15, "up": -0.04}, [0.15, 0.0, 0.0, -0.03]),
    ],
)
def test_of_what_is_impossible_the_nearest_is_done_and_said(
    asked: dict[str, float], done: list[float]
) -> None:
    bench = thrusting(0.12)
    bench.set("command", number=2, replaces=True, **{"ahead": 0.0, **asked})
    bench.step()
    goal = bench.get("goal")
    assert int(goal.outcome) == PlanOutcome.NEAREST
    assert bench.block.metrics() == {"targets_changed": 1, "targets_not_reached": 1}
    found = [*np.asarray(goal.position), float(goal.heading), float(goal.height)]
    assert found == pytest.approx(done, abs=5e-3)


def test_a_turn_and_a_height_change_before_lift_off() -> None:
    unmoved = touchdown_of(thrusting(0.2))
    bench = thrusting(0.2)
    bench.set("terms", centroidal_matrix=np.eye(6, 16) * 0.1, base_rotation=np.eye(3))
    bench.set("command", number=2, ahead=0.15, turn=0.2, up=0.02, replaces=True)
    bench.step()
    assert int(bench.get("goal").outcome) == PlanOutcome.PLANNED
    com, feet = touchdown_of(bench)
    reference = bench.get("reference")
    turned, still = feet - feet.mean(axis=0), unmoved[1] - unmoved[1].mean(axis=0)
    cosine, sine = math.cos(0.2), math.sin(0.2)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    assert com - unmoved[0] == pytest.approx([0.0, 0.0, 0.02], abs=1e-3)
    assert feet.mean(axis=0) - unmoved[1].mean(axis=0) == pytest.approx([0.0, 0.0, 0.02], abs=1e-3)
    assert turned == pytest.approx(still @ turn.T, abs=1e-3)
    assert np.asarray(reference.foot_yaw) == pytest.approx(0.2, abs=1e-3)
    assert float(np.asarray(reference.orientation)[2]) == pytest.approx(math.sin(0.1), abs=0.01)
    assert float(np.asarray(reference.angular_momentum)[2]) > 0.05


def test_a_landing_moves_more_than_once_without_a_jerk() -> None:
    bench = thrusting(0.25)
    reference, goal = bench.get("reference"), bench.get("goal")
    unmoved = touchdown_of(thrusting(0.25))
    speeds = []
    for number, (left, aside) in enumerate(((0.25, 0.04), (0.18, -0.02), (0.12, 0.02)), start=2):
        while reference.lift_off_time - reference.time > left:
            bench.set("phase", phase=Phase(int(reference.phase)))
            bench.step()
            speeds.append(np.array(reference.com_velocity)[1])
        bench.set("command", number=number, ahead=0.15, aside=aside, replaces=True)
        bench.step()
        assert np.asarray(goal.position) == pytest.approx([0.15, aside])
    moved = touchdown_of(bench)
    assert (moved[0] - unmoved[0])[1] == pytest.approx(0.02, abs=1e-3)
    assert (moved[1] - unmoved[1])[:, 1] == pytest.approx(0.02, abs=1e-3)
    assert max(np.abs(np.diff(speeds))) < 0.012, "of its 3 m/s^2 in 2 ms, and the plan's"


def test_in_flight_the_feet_move_and_the_centre_of_mass_does_not() -> None:
    def flying() -> BlockBench[SteeredPlan]:
        bench = thrusting(0.0)
        reference = bench.get("reference")
        for _ in range(30):
            bench.set("phase", phase=Phase(int(reference.phase)))
            bench.step()
        assert int(reference.phase) == Phase.FLIGHT
        return bench

    unmoved = touchdown_of(flying())
    bench = flying()
    goal = bench.get("goal")
    bench.set("command", number=2, ahead=0.18, turn=0.1, up=0.02, replaces=True)
    bench.step()
    assert int(goal.outcome) == PlanOutcome.NEAREST
    assert [*np.asarray(goal.position), float(goal.heading)] == pytest.approx([0.17, 0.0, 0.1])
    assert float(goal.height) == 0.0, "in flight it cannot rise"
    com, feet = touchdown_of(bench)
    assert com == pytest.approx(unmoved[0])
    middle = (feet - unmoved[1]).mean(axis=0)
    assert middle == pytest.approx([0.02, 0.0, 0.0], abs=1e-3)
    assert np.asarray(bench.get("reference").foot_yaw) == pytest.approx(0.1, abs=1e-3)


def test_a_later_command_waits_for_the_next_jump() -> None:
    bench = thrusting(0.09)
    bench.set("command", number=2, ahead=0.18, replaces=True)
    bench.step()
    assert int(bench.get("request").command) == 1
    assert np.asarray(bench.get("goal").position) == pytest.approx([0.15, 0.0])
