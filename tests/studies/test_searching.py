"""Search with Optuna: equal effort, better than the best random draw, the same again and resumed."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest

from aloft.runtime.language.errors import AloftError
from aloft.studies.execution import Run
from aloft.studies.journal import Outcome
from aloft.studies.searching import AT_ONCE, search, value_to_minimise
from aloft.studies.study import Study
from aloft.studies.tuning import Draw, order, tuning_cells

pytest.importorskip("optuna")

Read = Callable[[str], Study]
TEXT = """
arms:
  fixed: {set: {counter.goal: 1}, tune: {}}
  one: {tune: {counter.goal: [0, 100], double.goal: {from: 1 cm, to: 1 m, log: true}}}
  two: {tune: {counter.goal: {choices: [10, 20, 30]}}}
tune: {seeds: 5:7, draws: 30, least: metric}
"""


def judged(run: Run) -> Outcome:
    """The metric is least at a goal of 42 and at 10 cm; seed 6 fails far from it."""
    goal = float(run.cell.overrides.get("counter.goal", 0))
    other = float(str(run.cell.overrides.get("double.goal", "100 cm")).removesuffix(" cm"))
    metric = abs(goal - 42.0) + abs(other - 10.0)
    return Outcome(run.seed == 5 or metric < 60.0, "", metrics={"metric": metric})


def searched(study: Study, most: int = 10**9) -> tuple[dict[str, Draw] | None, list[Any]]:
    made: list[Any] = []

    def make(runs: Sequence[Run]) -> list[Run] | None:
        if len(made) + len(runs) > most:
            return None
        made.extend((run.key, dict(run.cell.overrides)) for run in runs)
        return [replace(run, outcome=judged(run)) for run in runs]

    cells = [replace(cell, key=str(n)) for n, cell in enumerate(tuning_cells(study))]
    return search(study, cells, make), made


def test_every_arm_gets_the_same_effort_and_a_better_set_is_found(study: Read) -> None:
    found = study(TEXT)
    best, made = searched(found)
    assert best is not None
    assert len(made) == 2 * (1 + 30 + 30)
    assert best["fixed"].values == {} and best["fixed"].number == 0
    one = best["one"]
    assert one.successes == 2 and one.least < 25.0
    assert best["two"].values == {"counter.goal": 30}
    # draw 0 is the arm as it is written, so tuning never ends below it
    assert made[0][1] == {"counter.goal": 1}


def test_the_same_is_proposed_again_and_after_a_stop(study: Read) -> None:
    found = study(TEXT)
    best, made = searched(found)
    assert searched(found) == (best, made)
    stopped, part = searched(found, most=2 * (1 + 2 + 2 * AT_ONCE))
    assert stopped is None and made[: len(part)] == part and len(part) > 2 * AT_ONCE
    assert found.tuning is not None
    assert searched(replace(found, tuning=replace(found.tuning, seed=1)))[1] != made


def test_the_value_orders_draws_as_the_random_search_does() -> None:
    draws = [
        Draw(0, {}, 4, 3, 5.0), Draw(1, {}, 4, 4, 1e9), Draw(2, {}, 4, 4, -7.0), Draw(3, {}, 4, 0),
        Draw(4, {}, 4, 3, 4.5),
    ]  # fmt: skip
    assert sorted(draws, key=order) == sorted(draws, key=lambda d: value_to_minimise(d, 4))


def test_optuna_is_asked_for(study: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(AloftError, match=r"aloft tune needs Optuna: pip install 'aloft\[tune\]'"):
        searched(study(TEXT))
