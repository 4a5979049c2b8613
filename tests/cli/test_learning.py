"""``aloft jump --learn``: a robot jumps, and each jump is corrected by what those before it have taught."""

from pathlib import Path

import pytest

from aloft.planner.library.learnt import read_learnt
from aloft.studies.rehearsing.learning import ladder

from .conftest import CallJson


def test_a_ladder_begins_small_and_ends_half_as_far() -> None:
    assert ladder({}, 0.12) == [{"rise": 0.02}, {"rise": 0.05}, {"rise": 0.08}]
    assert ladder({"rise": 0.06}, 0.06) == [{"rise": 0.02}, {"rise": 0.05}]
    asked = {"rise": 0.12, "distance_x": 0.2, "landing_height": -0.1}
    assert ladder(asked, 0.12) == [
        {"rise": 0.02}, {"rise": 0.05}, {"rise": 0.08}, {"rise": 0.12},
        {"rise": 0.12, "distance_x": 0.1},
    ]  # fmt: skip


@pytest.mark.long
def test_it_jumps_twice_and_the_second_is_corrected(folder: Path, call_json: CallJson) -> None:
    words = ("jump", "--learn", "mine.json", "--trial", "standard")
    found = call_json(*words, "--times", "2", "--seed", "3")
    first, second = found["jumps"]
    assert found["success"] is True
    assert first["velocity"] == [0.0, 0.0, 0.0]
    assert any(second["velocity"]) and any(second["momentum"])
    assert first["lesson"]["place"] != second["lesson"]["place"], "each jump has noise of its own"
    learnt = read_learnt(folder / "mine.json", "bruce")
    assert [lesson.task for lesson in learnt.lessons] == ["in_situ_12cm", "in_situ_12cm"]
    assert (folder / "recordings" / "jump.rrd").stat().st_size > 100_000


@pytest.mark.parametrize("option", [("--seeds", "0:3"), ("--no-record",), ("--rehearse",)])
def test_what_does_not_go_together_is_said(call_json: CallJson, option: tuple[str, ...]) -> None:
    found = call_json("jump", "--learn", "mine.json", *option, code=2)
    assert "one recorded jump after the other" in found["reason"]


def test_a_real_robot_is_asked_for_one_jump_at_a_time(call_json: CallJson) -> None:
    graph = str(Path(__file__).parents[2] / "graphs" / "jump_robot.yaml")
    words = ("jump", "--graph", graph, "--learn", "mine.json", "--ladder")
    assert "a real robot jumps once a command" in call_json(*words, code=2)["reason"]


def test_a_graph_that_takes_no_corrections_is_refused(folder: Path, call_json: CallJson) -> None:
    deaf = "targets.velocity_correction=[0, 0, 0]"
    found = call_json("jump", "--learn", "mine.json", "--set", deaf, code=2)
    assert "include controllers/planned.yaml" in found["reason"]
