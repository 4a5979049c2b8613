"""A task file with changes: what is merged, what takes whose place, and the name."""

from pathlib import Path
from typing import Any

import pytest

from aloft.planner.task.changed_task import changed_task, spoken
from aloft.planner.task.task import TaskError, make_task

TEXT = "rise: 12 cm\nweights: {force: 0.01, impulse: 5}\nmargins: {joints: 0.06 rad}\n"


@pytest.fixture
def hop(tmp_path: Path) -> Path:
    path = tmp_path / "hop.yaml"
    path.write_text(TEXT)
    return path


def test_changes_are_merged_also_inside_weights_and_margins(hop: Path) -> None:
    changes = {"distance_x": "20 cm", "weights": {"impulse": 2}, "margins": {"pressure": 0.1}}
    task = changed_task(hop, changes)
    assert (task.rise, task.distance_x) == (0.12, 0.2)
    assert (task.weights.force, task.weights.impulse) == (0.01, 2.0)
    assert task.margins is not None
    assert (task.margins.joints, task.margins.pressure) == (0.06, 0.1)


def test_a_speed_takes_the_place_of_the_rise(hop: Path) -> None:
    task = changed_task(hop, {"take_off_speed": "1.5 m/s"})
    assert (task.rise, task.take_off_speed) == (None, 1.5)


def test_a_changed_task_is_called_by_what_it_asks_for(hop: Path) -> None:
    assert changed_task(hop, {"distance_x": 0.2}).name == "12 cm high, 20 cm ahead"
    assert changed_task(hop, {"distance_x": 0.2, "name": "far"}).name == "far"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rize": 0.1}, "task: rize: is no parameter of a task; the nearest is rise"),
        ({"rise": "12 deg"}, "task: rise: expected a number in m, found '12 deg'"),
        ({"distance_x": 0.05, "landing_height": 0.05}, "task: step_edge: the step's edge"),
    ],
)
def test_a_wrong_change_is_named(hop: Path, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(TaskError) as caught:
        changed_task(hop, changes)
    assert str(caught.value).startswith(words)


def test_what_is_wrong_in_the_file_has_its_line(hop: Path) -> None:
    hop.write_text(TEXT + "distans: 3\n")
    with pytest.raises(TaskError, match=r"hop.yaml:4:1: distans"):
        changed_task(hop, {"rise": 0.1})


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"rise": 0.12, "distance_x": -0.1, "distance_y": -0.05}, "12 cm high, 10 cm back, 5 cm to the right"),
        ({"rise": 0.1, "twist": 0.5235987755982988}, "10 cm high, turned 30 deg"),
        ({"rise": 0.1, "landing_height": -0.05, "distance_x": 0.2}, "10 cm high, 20 cm ahead, 5 cm down"),
        ({"rise": 0.1, "repeat": 3}, "3 jumps"),
        ({"take_off_speed": 1.5}, "1.5 m per s up"),
    ],
)  # fmt: skip
def test_the_words(values: dict[str, Any], words: str) -> None:
    assert spoken(make_task({"name": "", **values})) == words
