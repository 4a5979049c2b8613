"""Falsification: what the search goes down, that it beats chance, the simplest failure, the test that is kept."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from runpy import run_path
from typing import Any

import pytest
from tests.needed import needs

import aloft
from aloft.extensions.analysis.studies.falsification import (
    AT_ONCE,
    Attempt,
    Search,
    end_cells,
    graph_text,
    judged,
    keep,
    margin_of,
    nominal_number,
    search,
    searched_cells,
    share_of,
    simplify,
)
from aloft.files.problems import LoadError
from aloft.runtime.language.errors import AloftError
from aloft.studies.execution import Run
from aloft.studies.expansion import Cell, checked_cells
from aloft.studies.journal import Outcome
from aloft.studies.study import MarginTerm, Range, Study

needs("optuna")

Read = Callable[[str], Study]
Judge = Callable[[Run], Outcome]
TEXT = """
set: {counter.goal: 0, double.goal: 0}
falsify:
  draws: 120
  margin: {load_n: [0, 8]}
  smallest: counter.goal
  ranges:
    counter.goal: [0, 10]
    double.goal: [0, 4]
    double.warning: {choices: [a, b]}
"""


def load_of(run: Run) -> float:
    """The least first parameter that fails is 6, and 8 where the second is as the graph says."""
    values = run.cell.overrides
    return float(values.get("counter.goal", 0) + 0.5 * values.get("double.goal", 0))


def loaded(run: Run) -> Outcome:
    load = load_of(run)
    return Outcome(load < 8.0, "" if load < 8.0 else "broke", "hash", {"load_n": load})


def cells_of(found: Study) -> list[Cell]:
    return [replace(cell, key=str(n)) for n, cell in enumerate(searched_cells(found))]


def falsified(
    found: Study, judge: Judge = loaded, **options: Any
) -> tuple[Search, list[list[Run]]]:
    """The search, and the batches of runs that it made."""
    batches: list[list[Run]] = []

    def make(runs: Sequence[Run]) -> list[Run]:
        batches.append([replace(run, outcome=judge(run)) for run in runs])
        return batches[-1]

    return search(found, cells_of(found), make, **options), batches


def simplified(found: Study, attempt: Attempt, judge: Judge = loaded) -> Attempt:
    return simplify(
        found,
        attempt,
        cells_of(found)[0],
        lambda runs: [replace(run, outcome=judge(run)) for run in runs],
    )


def with_seed(found: Study, seed: int) -> Study:
    assert found.falsification is not None
    return replace(found, falsification=replace(found.falsification, seed=seed))


def test_the_smallest_failure_is_found_and_chance_does_not_find_it(study: Read) -> None:
    found = study(TEXT)
    reached: dict[bool, list[float]] = {False: [], True: []}
    for seed in range(3):
        for random, values in reached.items():
            done, _ = falsified(with_seed(found, seed), random=random)
            assert done.worst.failed and len(done.attempts) == 120
            values.append(float(done.worst.values["counter.goal"]))
    assert max(reached[False]) < 6.25
    assert sum(reached[False]) < sum(reached[True]) - 0.5


@pytest.mark.long
def test_draws_come_in_batches_whatever_makes_them_and_the_same_again(study: Read) -> None:
    found = study(TEXT)
    done, batches = falsified(found)
    assert [len(batch) for batch in batches] == [3, *[3 * AT_ONCE] * 7, 3 * 7]  # three seeds
    assert done.attempts[0].values == {} and {run.seed for run in batches[1]} == {0, 1, 2}
    assert falsified(found)[0] == done
    values = [each.value for each in done.progress]
    assert values == sorted(values, reverse=True) and done.progress[-1] is done.worst
    assert done.failures == sum(each.value <= 0 for each in done.attempts)
    assert falsified(with_seed(found, 1))[0] != done


def test_a_draw_counts_by_the_worst_of_its_runs(study: Read) -> None:
    found = study(TEXT)
    section = found.falsification
    assert section is not None
    cell = cells_of(found)[0]

    def attempt(*outcomes: Outcome) -> Attempt:
        runs = [Run(cell, seed, outcome) for seed, outcome in enumerate(outcomes)]
        return judged(3, {"counter.goal": 2.5}, runs, section)

    good, near = (Outcome(True, "", "h", {"load_n": load}) for load in (2.0, 6.0))
    bad = Outcome(False, "broke", "h", {"load_n": 1.0})
    assert (attempt(good, near).margin, attempt(good, near).worst.seed) == (0.25, 1)
    assert (attempt(near, bad, good).value, attempt(near, bad).worst.seed) == (0.25 - 1.0, 1)
    with pytest.raises(AloftError, match="draw 3 could not be run: no such number"):
        attempt(good, Outcome(False, "no such number", error="no such number"))


def test_the_margin_says_how_near_a_run_is_to_failing() -> None:
    terms = (MarginTerm("tilt_deg", 0.0, 45.0), MarginTerm("inside_m", 0.03, 0.01))

    def margin(success: bool, **metrics: Any) -> float:
        return margin_of(Outcome(success, "", metrics=metrics), terms)

    assert margin(True, tilt_deg=9.0, inside_m=0.02) == pytest.approx(0.5)
    assert margin(True, tilt_deg=36.0, inside_m=0.03) == pytest.approx(0.2)
    assert margin(True, tilt_deg=50.0) == 1e-6  # judged by something else
    assert margin(True, tilt_deg=None, inside_m=float("nan")) == margin(True, tilt_deg=-9.0) == 1.0
    assert margin(False, tilt_deg=67.5, inside_m=0.02) == -0.5
    assert margin(False, tilt_deg=450.0) == -1.0
    assert margin(False, tilt_deg=9.0) == margin(False) == 0.0


def test_values_in_ranges(study: Read) -> None:
    found = study("")
    where = found.tasks[0].where
    force = Range("push.force", where, ((10.0, 30.0),), unit="N")
    assert share_of(force, "15 N") == 0.25 and share_of(force, "0.02 kN") == 0.5
    gain = Range("a.b", where, ((0.01, 1.0),), log=True)
    assert share_of(gain, 0.1) == pytest.approx(0.5)
    graph = aloft.load("count.yaml", {"counter.goal": 3.5}).checked
    assert nominal_number(graph, Range("counter.goal", where, ((0, 1),))) == 3.5
    assert nominal_number(graph, Range("counter.warning", where, ((0, 1),))) is None
    assert nominal_number(graph, Range("counter.gaol", where, ((0, 1),))) is None
    pushed = aloft.load("graphs/push.yaml" if Path("graphs").is_dir() else _push()).checked
    angle = Range("push.duration", where, ((0, 1),), unit="ms")
    assert nominal_number(pushed, angle) == pytest.approx(10.0)


def _push() -> str:
    return str(Path(aloft.__file__).parent / "graphs" / "push.yaml")


def test_a_failure_is_made_simple(study: Read) -> None:
    found = study(TEXT)
    runs = [Run(cells_of(found)[0], 1, Outcome(False, "broke", "h"))]
    assert found.falsification is not None
    values = {"counter.goal": 9.37, "double.goal": 3.21, "double.warning": "b"}
    first = judged(7, values, runs, found.falsification)
    simple = simplified(found, first)
    assert simple.values.keys() == {"counter.goal"}  # it fails without the two others
    assert 8.0 <= simple.values["counter.goal"] <= 8.0 + 9.37 / 5**3
    assert (simple.number, simple.worst.seed, simple.failed) == (7, 1, True)
    small = {"counter.goal": 7.0, "double.goal": 3.21, "double.warning": "b"}
    simple = simplified(found, judged(7, small, runs, found.falsification))
    assert simple.values.keys() == {"counter.goal", "double.goal"}
    assert load_of(simple.worst) == pytest.approx(8.0, abs=0.1)
    # the second is rounded where a rounder number still fails
    both = {"counter.goal": 5.0, "double.goal": 3.877}
    broken = simplified(
        found,
        judged(7, both, runs, found.falsification),
        lambda run: Outcome(
            run.cell.overrides["double.goal"] < 3.6 or load_of(run) < 6.0, "", "hash"
        ),
    )
    assert broken.values["double.goal"] == 4


def test_without_smallest_the_worst_is_sought_and_all_goes_back(study: Read) -> None:
    found = study(TEXT.replace("  smallest: counter.goal\n", "").replace("draws: 120", "draws: 60"))
    done, _ = falsified(found)
    assert done.worst.value < -0.45  # (8 - 12) / 8 at the corner
    assert load_of(simplified(found, done.worst).worst) == pytest.approx(8.0, abs=0.1)


def test_a_graph_that_fails_as_it_is_written(study: Read) -> None:
    done, batches = falsified(study(TEXT), lambda run: Outcome(False, "broke", "h"))
    assert len(batches) == 1 and done.worst.values == {} and done.failures == 1


def test_a_metric_that_no_run_has(study: Read) -> None:
    found = study(TEXT.replace("load_n", "load"))
    with pytest.raises(AloftError, match=r"counts load, .*: load_n; did you mean load_n\?"):
        falsified(found)


def test_the_failure_is_a_graph_of_a_few_lines_and_a_test(study: Read, folder: Path) -> None:
    (folder / "trial.yaml").write_text("set: {double.warning: careful}\n")
    found = study("include: trial.yaml\n" + TEXT)
    cell = cells_of(found)[0].with_sets({"counter.goal": 99.5}, found.tasks[0].where)
    failed = Run(cell, 4, Outcome(False, 'counted "too" far', "h"))
    attempt = Attempt(3, {"counter.goal": 99.5}, failed, 0.0, 0.0)
    (folder / "tests").mkdir()
    text = graph_text(found, attempt, Path("tests"))
    assert text.splitlines() == [
        '# Found by `aloft falsify ../study.yaml`: counted "too" far',
        'include: ["../trial.yaml", "../count.yaml"]',
        "set:",
        "  counter.goal: 99.5",
        "  double.goal: 0",
        "  counter.seed: 4",
        "  double.seed: 4",
    ]
    test, graph = keep(text, 'counted "too" far', Path("tests/test_load.py"))
    result = aloft.load(graph).run()
    assert not result.success and result.metrics["counter.last_count"] == 104
    with pytest.raises(AssertionError, match="counted too far"):
        run_path(str(test))["test_load"]()
    with pytest.raises(AloftError, match=r"test_load.py is there already; give another name"):
        keep(text, "", test)
    for name in ("load.py", "test_load.txt", "test_a-b.py"):
        with pytest.raises(AloftError, match="expected a name that pytest finds"):
            keep(text, "", Path(name))
    with pytest.raises(AloftError, match="cannot write"):
        keep(text, "", Path("nowhere/test_load.py"))


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("  draws: 120\n", "", "'falsify' does not say its draws"),
        ("draws: 120", "draws: few", "draws cannot be the text 'few'"),
        ("  margin: {load_n: [0, 8]}\n", "", "does not say how near a run is to failing"),
        ("[0, 8]", "8", "the margin of load_n cannot be 8"),
        ("[0, 8]", "[8, 8]", "expected two different numbers, the best value and the limit"),
        ("{load_n: [0, 8]}", "load_n", "'margin' cannot be the text 'load_n'"),
        ("smallest: counter.goal", "smallest: counter.gaol", "fix smallest: counter.goal"),
        ("smallest: counter.goal", "smallest: double.warning", "expected counter.goal, double.goal"),
        ("smallest:", "least:", "'least' .*of 'falsify'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_reported(study: Read, old: str, new: str, problem: str) -> None:
    with pytest.raises(LoadError) as raised:
        study(TEXT.replace(old, new))
    assert re.search(problem, " ".join(str(raised.value).split())), str(raised.value)


def test_ranges_must_be_there_and_fit(study: Read) -> None:
    with pytest.raises(LoadError, match="'falsify' has no ranges to search in"):
        study(TEXT[: TEXT.index("  ranges:")])
    found = study(TEXT.replace("double.goal: [0, 4]", "counter.seed: [-1, 4]"))
    cells = searched_cells(found)
    with pytest.raises(LoadError, match=r"counter\.seed cannot be"):
        checked_cells([*cells, *end_cells(found, cells)], found, "")
    with pytest.raises(AloftError, match="has no section 'falsify'"):
        searched_cells(study(""))
