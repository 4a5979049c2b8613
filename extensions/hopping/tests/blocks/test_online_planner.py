"""``OnlinePlanner`` hands a valid plan over part by part, and says which plan it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aloft.extensions.hopping.blocks.online_planner import OnlinePlanner
from aloft.extensions.hopping.planner.plan_outcome import PlanOutcome
from aloft.extensions.hopping.signals import SEGMENT_ROWS
from aloft.planner.library.jump_table import COLUMNS
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


def parts_of(bench: BlockBench[OnlinePlanner], number: int, **request: float):
    bench.set("request", number=number, **request)
    found = []
    while not found or found[-1]["segment"] + 1 < found[-1]["segments"]:
        bench.step()
        found.append({name: view.copy() for name, view in bench.get("segment")})
        assert len(found) < 20
    return found


@pytest.mark.long
def test_a_plan_comes_in_parts_and_repeats_to_the_byte() -> None:
    bench = BlockBench(OnlinePlanner, robot="bruce", rate=100.0)
    bench.step()
    assert bench.get("segment").number == 0
    first = parts_of(bench, 1, ahead=0.12, aside=0.03, turn=0.2)
    assert [int(segment["segment"]) for segment in first] == list(range(len(first)))
    assert all(int(segment["outcome"]) == PlanOutcome.PLANNED for segment in first)
    time = np.concatenate([segment["time"] for segment in first])
    assert (np.diff(time) >= 0.0).all() and len(time) == len(first) * SEGMENT_ROWS
    rows = np.concatenate([segment["rows"] for segment in first])
    assert rows.shape[1] == 25 + 8 * 2 + 4 * 10
    # where the feet are in the end: their columns stand behind seven columns of three and one of four
    begin = 3 * 3 + 4 + 3 + 3 + 3 + 3
    assert COLUMNS[8] == "foot_position"
    middle = rows[-1, begin : begin + 6].reshape(2, 3).mean(axis=0)
    assert middle == pytest.approx([0.12, 0.03, 0.0], abs=2e-3)
    again = parts_of(
        BlockBench(OnlinePlanner, robot="bruce", rate=100.0), 1, ahead=0.12, aside=0.03, turn=0.2
    )
    for one, other in zip(first, again, strict=True):
        assert all(one[name].tobytes() == other[name].tobytes() for name in one)


@pytest.mark.long
def test_a_jump_out_of_reach_is_replaced_by_the_nearest() -> None:
    bench = BlockBench(OnlinePlanner, robot="bruce", rate=100.0)
    segment = parts_of(bench, 1, ahead=0.8, aside=0.0, turn=0.0)[-1]
    assert int(segment["outcome"]) == PlanOutcome.NEAREST
    assert float(segment["ahead"]) == pytest.approx(0.32)
    assert bench.block.metrics()["plans_nearest"] == 1


def test_a_robot_without_stored_plans_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))  # where a user's own plans are kept
    with pytest.raises(BlockError, match="there are no stored plans of hops for solo12"):
        BlockBench(OnlinePlanner, robot="solo12", rate=100.0)
