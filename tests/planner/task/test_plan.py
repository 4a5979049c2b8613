"""The plan's file: exact, deterministic, readable without aloft, never half written."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aloft.planner.task.plan import (
    ARRAYS,
    PlanFileError,
    PlannedJump,
    plan_bytes,
    read_plan,
    write_plan,
)


def test_a_plan_comes_back_to_the_last_bit(by_hand: PlannedJump, tmp_path: Path) -> None:
    plan = replace(by_hand, statistics={"cost": np.float64(0.1)}, versions={"casadi": "3.8"})
    again = read_plan(write_plan(tmp_path / "folder" / "plan.npz", plan))
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(again, name), getattr(plan, name))
    assert again.task == plan.task
    assert again.statistics == {"cost": 0.1}
    assert again.versions == {"casadi": "3.8"}
    assert again.lift_off_time == plan.lift_off_time
    assert plan_bytes(again) == plan_bytes(plan)


def test_the_file_can_be_read_with_numpy_alone(by_hand: PlannedJump, tmp_path: Path) -> None:
    names = {"contacts": ["right_toe", "right_heel", "left_toe", "left_heel"]}
    path = write_plan(tmp_path / "plan.npz", by_hand, names)
    with np.load(path) as file:
        header = json.loads(str(file["header"]))
        assert file["com"].shape == (len(by_hand.time), 3)
    assert header["task"]["name"] == "by_hand"
    assert header["units"]["com"] == "m in the world frame"
    assert header["names"] == names


def test_nothing_but_the_plan_is_left_in_the_folder(by_hand: PlannedJump, tmp_path: Path) -> None:
    for _ in range(2):
        write_plan(tmp_path / "plan.npz", by_hand)
    with pytest.raises(TypeError):
        write_plan(tmp_path / "plan.npz", replace(by_hand, statistics={"solver": object()}))
    assert [path.name for path in tmp_path.iterdir()] == ["plan.npz"]
    assert read_plan(tmp_path / "plan.npz").task == by_hand.task


def test_what_is_no_plan_is_refused(by_hand: PlannedJump, tmp_path: Path) -> None:
    path = write_plan(tmp_path / "plan.npz", by_hand)
    with pytest.raises(PlanFileError, match=r"cannot read .*no\.npz: No such file"):
        read_plan(tmp_path / "no.npz")
    (tmp_path / "cut.npz").write_bytes(path.read_bytes()[:2000])
    with pytest.raises(PlanFileError, match="is no plan file"):
        read_plan(tmp_path / "cut.npz")
    np.savez(tmp_path / "other.npz", header=np.array(json.dumps({"format": "x"})), **{
        name: np.zeros(2) for name in ARRAYS
    })  # fmt: skip
    with pytest.raises(PlanFileError, match="is of format 'x', expected 'aloft jump plan 1'"):
        read_plan(tmp_path / "other.npz")


def test_arrays_of_different_length_are_refused(by_hand: PlannedJump) -> None:
    with pytest.raises(ValueError, match="com has 3 rows, but the plan has"):
        replace(by_hand, com=by_hand.com[:3])
    with pytest.raises(ValueError, match="times that never decrease"):
        replace(by_hand, time=by_hand.time[::-1])


def test_knot_at(by_hand: PlannedJump) -> None:
    middle = len(by_hand.time) // 4
    assert by_hand.knot_at(float(by_hand.time[middle])) == middle
    assert by_hand.knot_at(float(by_hand.time[middle]) + 1e-4) == middle
    assert by_hand.knot_at(-1.0) == 0


def test_processor_times_are_not_kept_so_that_bytes_repeat(by_hand: PlannedJump) -> None:
    plans = [
        replace(by_hand, statistics={"cpu_s": t, "solver_cpu_s": t, "iterations": 12})
        for t in (0.1, 0.2)
    ]
    assert plan_bytes(plans[0]) == plan_bytes(plans[1])
    assert plans[0].statistics["cpu_s"] == 0.1
