"""What is said of values and times."""

from pathlib import Path

import numpy as np
import pytest

from aloft.extensions.studio.live.texts import (
    MOST_LINES,
    ValueTexts,
    list_names,
    tick_text,
    time_texts,
)
from aloft.runtime.language.errors import AloftError
from aloft.runtime.language.signals import DTYPES
from aloft.runtime.loading import checked_file
from aloft.runtime.running.lateness import duration
from aloft.runtime.running.memory import Memory

MICROSECOND = 1000


@pytest.mark.parametrize(
    ("nanoseconds", "text"),
    [(950, "0.95 µs"), (28_640, "28.6 µs"), (999_400, "999 µs"), (999_700, "1 ms"),
     (12_345_678, "12.3 ms"), (2.5e9, "2.5 s")],
)  # fmt: skip
def test_durations(nanoseconds: float, text: str) -> None:
    assert duration(nanoseconds) == text


def test_the_time_of_a_block_is_that_of_all_its_calls() -> None:
    """``a`` emits and updates; ``b`` runs in one of two phases; calls of the runtime are left out."""
    programs = [("a", "b", "", "a"), ("a", "a~delay", "a")]
    first = np.cumsum([[0, 10, 40, 2, 5], [0, 20, 60, 2, 5]], axis=1) * MICROSECOND
    second = np.cumsum([[0, 30, 1, 5]], axis=1) * MICROSECOND
    found = time_texts(programs, [first, second], {"a": 1, "b": 0})
    assert found == {
        "a": ("25 µs", "median 25 µs, longest 35 µs of the last 3 runs; 1 deadline missed while it ran"),
        "b": ("50 µs", "median 50 µs, longest 60 µs of the last 2 runs; 0 deadlines missed while it ran"),
    }  # fmt: skip
    assert tick_text([first, second], 0.002) == "a tick takes 57 µs (longest 87 µs) of 2 ms"
    assert tick_text([first[:0]], 0.002) == ""
    assert time_texts([("a",)], [np.zeros((0, 2), np.int64)], {}) == {}


def test_values_have_units_and_names() -> None:
    graph = checked_file("aloft:jump")
    bus = Memory(graph.blocks, graph.robot).bus
    bus.field("robot.joints.position")[:] = 0.12345678
    bus.field("phase.phase.phase")[...] = 2
    texts = ValueTexts(graph, bus.layout)
    values, brief = texts.all(bus.buffer), texts.brief(bus.buffer)
    assert values["robot.joints.position"].startswith("[0.123457, 0.123457")
    assert values["robot.joints.position"].endswith("] rad")
    assert values["phase.phase.phase"] == "2 (thrust)"
    assert brief["robot.joints"] == "0.123, 0.123 …"
    assert brief["phase.phase"] == "thrust"
    assert "float64" in DTYPES and brief.keys() == {name.rpartition(".")[0] for name in values}


def test_lines_of_a_strip_chart() -> None:
    graph = checked_file("aloft:jump")
    bus = Memory(graph.blocks, graph.robot).bus
    texts = ValueTexts(graph, bus.layout)
    joints = texts.lines("robot.joints.position")
    assert joints["unit"] == "rad" and joints["size"] == 10
    assert "right_knee" in " ".join(joints["names"])
    phase = texts.lines("phase.phase.phase")
    assert phase["values"]["2"] == "thrust" and phase["names"] == ["phase"]
    bus.field("robot.joints.position")[0] = np.nan
    bus.field("phase.phase.phase")[...] = 2
    found = texts.numbers(
        bus.buffer, ["robot.joints.position", "phase.phase.phase", "no.such.field"]
    )
    assert found.keys() == {"robot.joints.position", "phase.phase.phase"}
    assert found["robot.joints.position"][0] is None and found["phase.phase.phase"] == [2.0]
    with pytest.raises(AloftError, match=r"there is no output field 'no\.such\.field'"):
        texts.lines("no.such.field")


def test_a_long_field_is_drawn_in_part(tmp_path: Path) -> None:
    file = tmp_path / "long.yaml"
    file.write_text(
        "rate: 100 Hz\nblocks:\n  wave: {use: blocks.SineWave, with: {n: 40, frequency: 1 Hz}}\n"
    )
    graph = checked_file(file)
    bus = Memory(graph.blocks, graph.robot).bus
    texts = ValueTexts(graph, bus.layout)
    about = texts.lines("wave.y.value")
    assert about["size"] == 40 and about["names"] == [str(k) for k in range(MOST_LINES)]
    assert len(texts.numbers(bus.buffer, ["wave.y.value"])["wave.y.value"]) == MOST_LINES


def test_lists_of_parameters_have_the_names_of_the_blocks_signals() -> None:
    """Joints and axes where the block's own vectors say so, else indices."""
    graph = checked_file("aloft:jump")
    joints = [names for path in graph.order if (names := list_names(graph, path, 10))[0] != "0"]
    assert joints and "right_knee" in " ".join(joints[0])
    assert list_names(graph, "phase", 3) == ["0", "1", "2"]
