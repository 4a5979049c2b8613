"""``SteeredPlan`` asks from where the feet are, begins a whole plan when it rests, and moves its frame."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aloft.blocks.jumping.steered_plan import SteeredPlan
from aloft.blocks.signals import Phase, PlanOutcome
from aloft.blocks.signals.steering import PART_ROWS
from aloft.planner.library.jump_table import table_rows
from aloft.planner.online.hop_plans import hop_table, shipped_samples
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

ROBOT = find_robot("bruce")


def at(
    bench: BlockBench[SteeredPlan], x: float, y: float, heading: float, phase: Phase, **more: float
) -> None:
    """Let the feet be there."""
    cosine, sine = math.cos(heading), math.sin(heading)
    turn = [[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]
    feet = [[x + side * sine * 0.07, y - side * cosine * 0.07, 0.0] for side in (1.0, -1.0)]
    bench.set("terms", foot_position=feet, foot_rotation=[turn, turn])
    bench.set("phase", phase=phase, **more)


def hand_over(
    bench: BlockBench[SteeredPlan], number: int, outcome: PlanOutcome, row: int = 0
) -> None:
    """Give all parts of a stored plan."""
    samples = shipped_samples("bruce")
    table = hop_table(samples.plan(row), ROBOT)
    rows, n = table_rows(table).rows, len(table.time)
    parts = -(-n // PART_ROWS)
    ahead, aside, turn = samples.requests[row]
    for part in range(parts):
        pick = np.minimum(np.arange(part * PART_ROWS, (part + 1) * PART_ROWS), n - 1)
        bench.set(
            "part", number=number, part=part, parts=parts, time=table.time[pick], rows=rows[pick],
            contact=table.contact[pick], marks=[table.squat_time, table.recover_time],
            jump=[table.thrust_time, table.lift_off_time, table.touchdown_time],
            outcome=outcome, ahead=ahead, aside=aside, turn=turn,
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
    # It lands 3 cm short, and a little to the left; the next command is another 10 cm.
    at(bench, 0.17, 0.01, 0.0, Phase.LANDING, time_since_touchdown=0.1)
    bench.set("command", number=2, ahead=0.1, aside=0.0, turn=0.0)
    bench.step()
    assert int(request.number) == 1, "it asks only when the feet have come to rest"
    bench.set("phase", time_since_touchdown=0.16)
    bench.step()
    assert int(request.number) == 2
    assert [float(request.ahead), float(request.aside)] == pytest.approx([0.13, -0.01])
    assert np.asarray(bench.get("goal").position) == pytest.approx([0.3, 0.0])


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


def test_what_cannot_be_done_moves_the_goal_to_what_is_done() -> None:
    bench = standing()
    bench.set("command", number=1, ahead=0.9, aside=0.0, turn=0.0)
    bench.step()
    hand_over(bench, 1, PlanOutcome.UNSOLVED, row=1)
    ahead, aside, turn = shipped_samples("bruce").requests[1]
    goal = bench.get("goal")
    assert np.asarray(goal.position) == pytest.approx([ahead, aside])
    assert float(goal.heading) == pytest.approx(turn)
    assert int(goal.outcome) == PlanOutcome.UNSOLVED


def test_feet_without_a_direction_are_refused() -> None:
    with pytest.raises(BlockError, match="is a point, which has no direction"):
        BlockBench(SteeredPlan, robot="go2")
