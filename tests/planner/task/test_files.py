"""Tasks and grids in files: every mistake with its line and column, and never a traceback.

Files that are whole or not there, and what a killed process leaves behind.
"""

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aloft.planner.task.files import ABANDONED, remove_abandoned, write_whole
from aloft.planner.task.read_task import read_task
from aloft.planner.task.task import JumpTask, JumpTaskError, make_task
from aloft.studies.batch.plan_grid import read_grid


def message(tmp_path: Path, text: str, read: Any = read_task) -> str:
    path = tmp_path / "odd.yaml"
    path.write_text(text)
    with pytest.raises(JumpTaskError) as caught:
        read(path)
    return str(caught.value).replace(f"{tmp_path}/", "")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("rise: 3 kg\n", "odd.yaml:1:7: rise: expected a number in m, found '3 kg'"),
        ("rise: 0.1\nhigth: 3\n", "odd.yaml:2:1: higth: is no parameter of a task; the nearest is weights"),
        ("rise: 0.1\nknots: {squat: 8, fligt: 9}",
         "odd.yaml:2:19: knots.fligt: is no parameter of a task; the nearest is flight"),
        ("rise: 0.1\nfriction: -1", "odd.yaml:2:11: friction: expected more than 0, found -1"),
        ("take_off_speed: 1\nrise: 0.1",
         "odd.yaml:2:1: give rise or take_off_speed, not both: one follows from the other"),
        ("name: x\n", "odd.yaml:1:1: say how high the jump is: rise, take_off_speed or flight_time"),
        ("rise: 0.1\nrobot: bruse", "odd.yaml:2:8: robot: no robot called 'bruse'; there is bruce, a1, alexander, anymal_c, "),
        ("rise: 0.1\ninitial:\n  right_ancle: 2 deg",
         "odd.yaml:3:16: initial.right_ancle: bruce has no joint right_ancle; the nearest is right"),
        ("rise: 0.1\njumps:\n  - {distance_x: 5 cm}\n  - {flight_time: 2 s}",
         "odd.yaml:4:19: jumps.1.flight_time: a rise of 0.1 m takes"),
        ("rise: 0.1\njumps: [{rize: 3}]", "odd.yaml:2:10: jumps.0.rize: is no parameter of a task; the nearest is rise"),
        ("rise: 0.1\nrise: 0.2", "odd.yaml:2:1: key 'rise' is there twice; remove one of the two"),
        ("- rise: 0.1", "odd.yaml:1:1: expected keys such as 'rise: 15 cm', found [{'rise': 0.1}]"),
        ("", "odd.yaml:1:1: expected keys such as 'rise: 15 cm', found nothing"),
        ("rise: [", "odd.yaml:1:8: did not find expected node content"),
    ],
)  # fmt: skip
def test_mistakes_of_a_task(tmp_path: Path, text: str, expected: str) -> None:
    assert message(tmp_path, text).startswith(expected)


def test_all_mistakes_at_once(tmp_path: Path) -> None:
    lines = message(tmp_path, "rise: 3 kg\nknots: {squat: 0}\ntwist: left\n").splitlines()
    assert [line.partition(": ")[0] for line in lines] == [
        "odd.yaml:1:7", "odd.yaml:3:8", "odd.yaml:2:16",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("grid: {rise: [0.1, 5 kg]}", "odd.yaml:1:20: rise: expected a number in m, found '5 kg'"),
        ("task: {friction: no}\ngrid: {rise: [0.1]}", "odd.yaml:1:18: friction: "),
        ("grid: {rize: [0.1]}", "odd.yaml:1:8: rize: is no parameter of a task; the nearest is rise"),
        ("grid: {rise: 0.1}", "odd.yaml:1:14: grid.rise: expected a list of values or {from"),
        ("grid: {rise: {from: 1 s, to: 2, count: 3}}",
         "odd.yaml:1:21: from: rise: expected a number in m, found '1 s'"),
        ("grid: {name: {from: 1, to: 2, count: 3}}", "odd.yaml:1:21: from: name: "),
        ("grid: {rise: {from: 1, to: 2, count: 30000}}", "odd.yaml:1:14: grid.rise: expected a list"),
        ("grid: {rise: [0.1]}\nextra: 1", "odd.yaml:2:1: extra: expected only name, task and grid"),
        ("task: 3\ngrid: {rise: [0.1]}", "odd.yaml:1:7: task: expected a mapping, found 3"),
        ("rise: 3", "odd.yaml:1:1: rise: expected only name, task and grid"),
        ("name: x", "odd.yaml:1:1: expected the keys name, task and grid"),
    ],
)  # fmt: skip
def test_mistakes_of_a_grid(tmp_path: Path, text: str, expected: str) -> None:
    assert message(tmp_path, text, read_grid).startswith(expected)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(JumpTaskError, match=r"cannot read .*nowhere\.yaml: No such file"):
        read_task(tmp_path / "nowhere.yaml")
    path = tmp_path / "bytes.yaml"
    path.write_bytes(b"rise: \xff")
    with pytest.raises(JumpTaskError, match=r"is not UTF-8 text \(byte 6\)"):
        read_task(path)


def test_numbers_are_what_people_mean(tmp_path: Path) -> None:
    path = tmp_path / "odd.yaml"
    path.write_text("rise: 1e-1\ntwist: 30 deg\n")
    task = read_task(path)
    assert task.rise == 0.1
    assert task.name == "odd"


KEYS = st.sampled_from([*JumpTask.model_fields, "squat", "count", "from", "to", "oops", ""])
SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8),
    st.sampled_from(["15 cm", "3 kg", "30 deg", "1e999 m", "full", "koala", "bruce", "-0.1"]),
)  # fmt: skip
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=4),
    max_leaves=8,
)
TASKS = st.dictionaries(KEYS, VALUES, max_size=6)
MANY = settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@MANY
@given(values=TASKS)
def test_whatever_values_are_a_task_or_a_clear_error(values: dict[str, Any]) -> None:
    try:
        task = make_task({"name": "any", **values})
    except JumpTaskError as error:
        assert all(line.startswith("task: ") for line in str(error).splitlines() if line)
    else:
        assert make_task(task.model_dump(mode="json")) == task


@MANY
@given(values=TASKS, other=TASKS)
def test_whatever_a_file_holds_is_a_task_or_a_clear_error(
    tmp_path: Path, values: dict[str, Any], other: dict[str, Any]
) -> None:
    path = tmp_path / "any.yaml"
    for read, content in (
        (read_task, {**values, "rise": 0.1}),
        (read_grid, {"task": other, "grid": values}),
        (read_grid, {"task": {"rise": 0.1}, "grid": {"friction": values, **other}}),
    ):
        path.write_text(yaml.safe_dump(content, allow_unicode=True), encoding="utf-8")
        try:
            read(path)
        except JumpTaskError as error:
            assert str(path) in str(error)


@MANY
@given(text=st.text(max_size=60))
def test_whatever_text_is_a_task_or_a_clear_error(tmp_path: Path, text: str) -> None:
    path = tmp_path / "any.yaml"
    path.write_text(text, encoding="utf-8", errors="replace")
    for read in (read_task, read_grid):
        with suppress(JumpTaskError):  # ``rise: 1`` is a task
            read(path)


def test_it_replaces_what_is_there(tmp_path: Path) -> None:
    path = tmp_path / "new" / "file"
    assert write_whole(path, b"one") == path
    write_whole(path, b"two")
    assert path.read_bytes() == b"two"
    assert list(path.parent.iterdir()) == [path]


def test_what_cannot_be_written_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_whole(tmp_path / "file", b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_whole(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_abandoned_parts_are_removed_and_young_ones_are_not(tmp_path: Path) -> None:
    old, young = tmp_path / ".a.npz.1.part", tmp_path / ".b.npz.2.part"
    for part in (old, young):
        part.write_bytes(b"half")
    time = young.stat().st_mtime - ABANDONED - 10.0
    os.utime(old, (time, time))
    remove_abandoned(tmp_path)
    remove_abandoned(tmp_path / "nowhere")
    assert list(tmp_path.iterdir()) == [young]
