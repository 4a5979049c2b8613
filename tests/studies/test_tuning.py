"""Tuning: equal effort, determinism, the best draw, the file, and what it is good for."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from aloft.runtime.language.errors import AloftError
from aloft.runtime.loading import LoadError
from aloft.studies.execution import Run
from aloft.studies.expansion import cells, checked_cells
from aloft.studies.journal import Outcome
from aloft.studies.reading import read_study
from aloft.studies.study import Study
from aloft.studies.tuning import (
    best_draws,
    draws,
    extreme_cells,
    read_tuned,
    tuning_cells,
    tuning_runs,
    write_tuned,
)

Read = Callable[[str], Study]
TEXT = """
arms:
  fixed: {set: {counter.goal: 1}, tune: {}}
  one: {set: {counter.goal: 2}, tune: {counter.goal: [0, 10]}}
  two: {}
grid: {stop: {counter.stop_at: [10, 20, 30]}}
tune:
  seeds: 5:7
  draws: 20
  where: {stop: [10, 30]}
  set: {double.goal: 9}
  least: metric_m
  ranges: {double.goal: {from: 1 cm, to: 1 m, log: true}, counter.goal: {choices: [1, 2]}}
"""


def done(found: Study, judge: Callable[[Run], Outcome]) -> list[tuple[str, int, Run]]:
    checked = [replace(cell, key=str(n)) for n, cell in enumerate(tuning_cells(found))]
    runs = tuning_runs(found, checked)
    return [(arm, draw, replace(run, outcome=judge(run))) for arm, draw, run in runs]


def test_every_arm_gets_the_same_draws_cells_and_seeds(study: Read) -> None:
    found = study(TEXT)
    runs = done(found, lambda run: Outcome(True, ""))
    for arm, count in (("fixed", 1), ("one", 20), ("two", 20)):
        mine = [(draw, run) for name, draw, run in runs if name == arm]
        assert len(mine) == count * 2 * 2
        tried = {(d, r.cell.labels["stop"], r.seed) for d, r in mine}
        assert tried == {(d, s, n) for d in range(count) for s in ("10", "30") for n in (5, 6)}
        assert all("double.goal" in run.cell.overrides for _, run in mine)
    keys = {run.key for _, _, run in runs}
    assert len(keys) == len(runs)


def test_draws_are_decided_by_seed_arm_and_number_alone(study: Read) -> None:
    found = study(TEXT)
    assert found.tuning is not None
    one, two = found.arms[1], found.arms[2]
    first = [draw.values for draw in draws(one, found.tuning)]
    assert first[0] == {} and len({str(values) for values in first}) == 20
    more = draws(one, replace(found.tuning, draws=30))
    assert [draw.values for draw in more[:20]] == first
    assert [d.values for d in draws(one, replace(found.tuning, seed=1))[1:]] != first[1:]
    assert [d.values for d in draws(replace(one, name="other"), found.tuning)[1:]] != first[1:]
    assert all(0 <= values["counter.goal"] <= 10 for values in first[1:])
    goals = [draw.values["double.goal"] for draw in draws(two, found.tuning)[1:]]
    numbers = [float(goal.removesuffix(" cm")) for goal in goals]
    assert all(1 <= number <= 100 for number in numbers)
    assert sum(number < 10 for number in numbers) in range(5, 15)  # half of them, in the logarithm
    assert {draw.values["counter.goal"] for draw in draws(two, found.tuning)[1:]} == {1, 2}


def test_the_best_succeeds_most_then_has_the_least_metric_then_is_the_first(study: Read) -> None:
    found = study(TEXT)

    def judge(run: Run) -> Outcome:
        goal = run.cell.overrides.get("counter.goal", 1)
        if run.cell.arm == "one":
            return Outcome(goal > 4, "", metrics={"metric_m": goal})
        return Outcome(True, "", metrics={"metric_m": math.nan if goal == 1 else 3.0})

    runs = done(found, judge)
    best = best_draws(found, runs)
    tried = [draw.values["counter.goal"] for draw in draws(found.arms[1], found.tuning)[1:]]  # type: ignore[arg-type]
    assert best["one"].values["counter.goal"] == min(goal for goal in tried if goal > 4)
    assert (best["one"].successes, best["one"].n) == (4, 4)
    assert best["fixed"].number == 0 and best["fixed"].values == {}
    again = best_draws(found, list(reversed(runs)))
    assert {arm: d.number for arm, d in again.items()} == {a: d.number for a, d in best.items()}


def test_the_file_is_read_back_and_belongs_to_what_was_tuned(study: Read) -> None:
    found = study(TEXT)
    with pytest.raises(AloftError, match=r"no study.tuned.yaml; run aloft study study.yaml --tune"):
        read_tuned(found)
    best = best_draws(found, done(found, lambda run: Outcome(run.cell.arm != "one", "")))
    best["two"] = replace(best["two"], values={"double.goal": "3 cm", "counter.goal": [1, 2.5]})
    assert write_tuned(found, best) == Path("study.tuned.yaml")
    tuned = read_tuned(found)
    assert tuned == {"fixed": {}, "one": {}, "two": dict(best["two"].values)}
    by_arm = {cell.arm: cell.overrides for cell in cells(found, tuned)}
    assert by_arm["two"]["double.goal"] == "3 cm"
    # more to report on is nothing new to tuning, other draws are
    assert read_tuned(study(TEXT.replace("20, 30]", "20, 25, 30]"))) == tuned
    for changed in (TEXT.replace("draws: 20", "draws: 21"), TEXT.replace("goal: 9", "goal: 8")):
        with pytest.raises(AloftError, match="was found for another study"):
            read_tuned(study(changed))


def test_ranges_are_tried_at_their_ends_before_anything_runs(study: Read) -> None:
    found = study("tune: {seeds: 1, draws: 2, ranges: {counter.seed: [-1, 3]}}\n")
    chosen = tuning_cells(found)
    with pytest.raises(LoadError, match=r"study.yaml:3:37: bad-parameter: counter.seed cannot be"):
        checked_cells([*chosen, *extreme_cells(found, chosen)], found, "")


def test_a_filter_may_leave_out_arms_that_are_not_tuned(study: Read) -> None:
    found = study(TEXT.replace("where: {", "where: {arm: two, "))
    assert {cell.arm for cell in tuning_cells(found)} == {"two"}
    assert read_study(found.path).tuning == found.tuning
