"""The table of the bring-up page that compares the twin with the simulation is made by a script that works."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from aloft.studies.reading import read_study

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def script(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("result_tables")


def run(task: str, arm: str, seed: int, success: bool, tilt: float | None = 5.0) -> dict[str, Any]:
    reason = "all criteria hold" if success else "it fell"
    return {"task": task, "arm": arm, "seed": seed, "success": success, "reason": reason,
            "peak_tilt_deg": tilt}  # fmt: skip


def summed(task: str, arm: str, successes: int, rise: float | None = None) -> dict[str, Any]:
    metrics = {} if rise is None else {"apex_above_standing_m": {"mean": rise}}
    return {"task": task, "arm": arm, "n": 3, "successes": successes, "metrics": metrics}


def test_the_table_names_the_seeds_that_differ_and_why(script: ModuleType) -> None:
    runs = [
        *(run("up", "simulation", seed, True, 4.0 + seed % 3) for seed in (9000, 9001, 9002)),
        *(run("up", "twin", seed, seed != 9001, 80.0 if seed == 9001 else 7.4)
          for seed in (9000, 9001, 9002)),
        *(run("push", arm, seed, False, None) for arm in script.ARMS for seed in (9000, 9001, 9002)),
        run("half", "twin", 9000, True),
    ]  # fmt: skip
    rows = [
        summed("up", "simulation", 3, 0.1234), summed("up", "twin", 2, 0.1211),
        summed("push", "simulation", 0), summed("push", "twin", 0), summed("half", "twin", 1),
    ]  # fmt: skip
    lines = script.twin_table(rows, runs).splitlines()
    assert lines[2:] == [
        "| up | 3 of 3 | 2 of 3 | 12.3 cm, 12.1 cm | 6 deg, 7 deg | 9001 |",
        "| push | 0 of 3 | 0 of 3 | -, - | -, - | - |",
        "",
        (
            "Seeds 9000 to 9002. In all 3 of 6 runs succeed in simulation and 2 on the twin: 1 of the pairs only in "
            "simulation, 0 only on the twin. If both succeeded equally often, a split at least as "
            "uneven would have the probability 1 (McNemar's exact test)."
        ),
        "",
        "- up, seed 9001: only the twin fails, it fell",
    ]


def test_equal_runs_need_no_test(script: ModuleType) -> None:
    runs = [run("up", arm, 9000, True) for arm in script.ARMS]
    rows = [summed("up", arm, 1) for arm in script.ARMS]
    assert "\n\nSeed 9000. In all 1 of 1" in script.twin_table(rows, runs)
    assert script.twin_table(rows, runs).endswith(
        ": 0 of the pairs only in simulation, 0 only on the twin.\n"
    )


def test_one_arm_alone_says_nothing(script: ModuleType) -> None:
    with pytest.raises(ValueError, match="no task was run by both arms"):
        script.twin_table([summed("up", "twin", 1)], [run("up", "twin", 9000, True)])


@pytest.mark.parametrize(
    ("first", "second", "chance"), [(0, 1, 1.0), (0, 5, 0.0625), (2, 8, 0.109375), (4, 4, 1.0)]
)
def test_mcnemars_exact_test(script: ModuleType, first: int, second: int, chance: float) -> None:
    """Against the binomial distribution by hand: 2 (1 + 10 + 45) / 2^10 for a split of 2 to 8."""
    assert script.equally_likely(first, second) == script.equally_likely(second, first) == chance


def test_the_study_runs_the_tasks_of_the_other_on_both(script: ModuleType) -> None:
    studies = ROOT / "graphs" / "studies"
    found, tasks = read_study(studies / "twin.yaml"), read_study(studies / "tasks.yaml")
    assert [task.name for task in found.tasks] == [task.name for task in tasks.tasks]
    assert tuple(arm.name for arm in found.arms) == script.ARMS
    assert [path.name for path in found.include] == [path.name for path in tasks.include]
