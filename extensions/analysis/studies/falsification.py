"""Searches the worst case of a study in ranges of parameters, and makes the failure that is found simple.

::

    falsify:
      ranges: {push.force: [0 N, 120 N], push.angle: [0 deg, 360 deg], push.delay: [0 s, 0.3 s]}
      margin: {peak_tilt_deg: [0, 45]}   # 1 at 0 degrees, 0 at the score's limit of 45
      smallest: push.force               # the smallest push that fells it; without: the worst run
      draws: 1000

What is drawn, and by which optimiser, is as in ``tuning``: draw 0 is the graph as it is written, the
others come in batches of a fixed size, so a search is the same on any number of processors.

The search goes down one number. Of a run that succeeds it is the margin, in (0, 1]: the least of the
terms of ``margin``. Of a run that fails it is in [-1, 0]: with ``smallest`` where this parameter lies in its
range, less 1; without, the margin. A draw counts by the worst of its runs. So the search first looks for a
failure, led by the margin, and then for a smaller or worse one (robustness-guided falsification: Annpureddy, Liu,
Fainekos and Sankaranarayanan, S-TaLiRo, TACAS 2011; for requirements on one number each).

Then the failure is made simple as property tests do it (MacIver and Donaldson, Test-Case Reduction
via Test-Case Generation, ECOOP 2020): parameters go back to what the graph says one by one, those that must not
go on half the way and further, and what is left is rounded, as long as the same run still fails.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from ....files.nodes import text_of
from ....files.problems import listing, nearest
from ....files.validation import unit_of
from ....runtime.language.errors import AloftError, UnitError
from ....runtime.language.stages import CheckedGraph
from ....runtime.language.units import parse_unit
from ....studies.execution import Run
from ....studies.expansion import Cell, cells, load_cell
from ....studies.journal import Outcome
from ....studies.quantities import in_unit, written
from ....studies.study import Falsification, MarginTerm, Range, Study
from ....studies.tuning import (
    Make,
    cells_at_ends,
    draw_runs,
    optuna_study,
    proposed,
    read_tuned,
)

AT_ONCE = 16
"""Draws that are proposed before the first of their results is known."""
SPACED = 4
"""Values between the failing one and the graph's that are tried at once."""
NARROWED = 3
"""Number of narrowing steps; the failure is then known to (1 + ``SPACED``)^-``NARROWED`` of the
way."""
MOST_PASSES = 3
"""Number of times that all parameters are made simpler in turn."""


@dataclass(frozen=True)
class Attempt:
    """One set of parameters with the worst of its runs; ``value`` is what the search goes down."""

    number: int
    values: Mapping[str, Any]
    worst: Run
    margin: float
    value: float

    @property
    def failed(self) -> bool:
        """True if the worst run does not succeed."""
        return self.worst.outcome is not None and not self.worst.outcome.success


@dataclass
class Search:
    """All attempts of a search, in order."""

    attempts: list[Attempt] = field(default_factory=list)

    @property
    def worst(self) -> Attempt:
        """The attempt with the least value, the first among equals."""
        return min(self.attempts, key=lambda each: each.value)

    @property
    def failures(self) -> int:
        """Number of attempts that failed."""
        return sum(each.failed for each in self.attempts)

    @property
    def progress(self) -> list[Attempt]:
        """The attempts that were worse than all before them."""
        found: list[Attempt] = []
        for each in self.attempts:
            if not found or each.value < found[-1].value:
                found.append(each)
        return found


def searched_cells(study: Study) -> list[Cell]:
    """Return the cells that every draw is tried on."""
    falsification = _section(study)
    expanded = cells(study, read_tuned(study), falsification.sets)
    return [cell for cell in expanded if falsification.cells.takes(cell.labels)]


def end_cells(study: Study, chosen: Sequence[Cell]) -> list[Cell]:
    """Return cells with each range at its ends. They are checked before anything runs."""
    return cells_at_ends(chosen[0], _section(study).ranges) if chosen else []


def _section(study: Study) -> Falsification:
    if study.falsification is None:
        raise AloftError(f"{study.path} has no section 'falsify'")
    return study.falsification


def margin_of(outcome: Outcome, terms: Sequence[MarginTerm]) -> float:
    """Compute the run's margin to failure: in (0, 1] if it succeeds, in [-1, 0] if it does not.

    A failed run without any of the metrics has the margin 0; so has one that fails by a criterion
    of which the margin knows nothing.
    """
    parts = [
        (term.limit - float(value)) / (term.limit - term.best)
        for term in terms
        if isinstance(value := outcome.metrics.get(term.metric), int | float)
        and math.isfinite(value)
    ]
    if outcome.success:
        return min(1.0, max(1e-6, min(parts, default=1.0)))
    return max(-1.0, min(0.0, *parts, 0.0))


def share_of(found: Range, value: Any) -> float:
    """Return the position of a value in the range of a number: 0 at the low end, 1 at the high one."""
    number = in_unit(value, found.unit)
    assert number is not None
    low, high = found.bounds[0]
    if found.log:
        low, high, number = math.log(low), math.log(high), math.log(number)
    return (number - low) / (high - low) if high > low else 0.0


def judged(
    number: int, values: Mapping[str, Any], runs: Sequence[Run], section: Falsification
) -> Attempt:
    """Judge the attempt with these parameters by its runs.

    Raises:
        AloftError: a run could not even begin.
    """
    for run in runs:
        if run.outcome is not None and not run.outcome.run_hash:
            raise AloftError(f"draw {number} could not be run: {run.outcome.reason}")
    made = [
        (margin_of(run.outcome, section.margin), run) for run in runs if run.outcome is not None
    ]
    margin, worst = min(
        made, key=lambda item: (bool(item[1].outcome and item[1].outcome.success), item[0])
    )
    value, key = margin, section.smallest
    if worst.outcome is not None and not worst.outcome.success and key in values:
        each = next(each for each in section.ranges if each.key == key)
        value = share_of(each, values[key]) - 1.0
    return Attempt(number, values, worst, margin, value)


def search(
    study: Study,
    chosen: Sequence[Cell],
    make: Make,
    *,
    random: bool = False,
) -> Search:
    """Search the worst case.

    Args:
        study: the study, with a section ``falsify``.
        chosen: its cells, checked.
        make: makes the runs of some draws.
        random: draw without regard to the results, for comparison.

    Returns:
        All attempts. If the graph fails as it is written, that is the only one.

    Raises:
        AloftError: Optuna is not installed, a run could not begin, or none has a metric of the margin.
    """
    section = _section(study)
    seeds = section.seeds or study.seeds
    found = Search()

    def tried(numbers: Sequence[int], draws: Sequence[Mapping[str, Any]]) -> list[Attempt]:
        planned = [
            draw_runs(values, f"draw {number}", chosen, seeds)
            for number, values in zip(numbers, draws, strict=True)
        ]
        done = make([run for runs in planned for run in runs])
        made = []
        for number, values in zip(numbers, draws, strict=True):
            mine, done = done[: len(planned[0])], done[len(planned[0]) :]
            made.append(judged(number, values, mine, section))
        found.attempts += made
        return made

    sampler = optuna_study("falsify", str(section.seed), random=random)
    (first,) = tried([0], [{}])
    if first.failed:
        return found
    _check_metrics(first.worst, section)
    for begin in range(1, section.draws, AT_ONCE):
        numbers = range(begin, min(begin + AT_ONCE, section.draws))
        trials = [sampler.ask() for _ in numbers]
        draws = [{each.key: proposed(each, trial) for each in section.ranges} for trial in trials]
        for trial, attempt in zip(trials, tried(numbers, draws), strict=True):
            sampler.tell(trial, attempt.value)
    return found


def _check_metrics(run: Run, section: Falsification) -> None:
    names = run.outcome.metrics if run.outcome is not None else {}
    for term in section.margin:
        if term.metric not in names:
            near = "".join(f"; did you mean {name}?" for name in nearest(term.metric, names)[:1])
            raise AloftError(
                f"the margin counts {term.metric}, which the run of the graph as it is written has "
                f"not; its metrics: {listing(names)}{near}"
            )


def simplify(study: Study, found: Attempt, base: Cell, make: Make) -> Attempt:
    """Find the simplest attempt that still fails, with the seed and in the cell of the worst run.

    Args:
        study: the study.
        found: a failed attempt.
        base: the checked cell of its worst run, without the draw.
        make: makes runs.
    """
    section = _section(study)
    ranges = {each.key: each for each in section.ranges}
    graph = load_cell(base.graph, base.include, base.sets, base.origin, base.behind).checked
    targets = {key: _target(graph, each, section) for key, each in ranges.items()}
    current = found

    def first_failing(candidates: Sequence[Mapping[str, Any]]) -> int | None:
        """Run all, and go on from the first that fails."""
        nonlocal current
        planned = [
            draw_runs(values, "simplified", [base], [found.worst.seed]) for values in candidates
        ]
        runs = make([run for (run,) in planned])
        for place, (values, run) in enumerate(zip(candidates, runs, strict=True)):
            attempt = judged(found.number, values, [run], section)
            if attempt.failed:
                current = attempt
                return place
        return None

    def without(key: str) -> dict[str, Any]:
        return {name: value for name, value in current.values.items() if name != key}

    def narrow(key: str, passing: float) -> None:
        """Bring a number nearer to where the run perhaps succeeds."""
        each = ranges[key]
        for _ in range(NARROWED):
            failing = in_unit(current.values[key], each.unit)
            assert failing is not None
            step = (failing - passing) / (SPACED + 1)
            numbers = [float(f"{passing + k * step:.4g}") for k in range(1, SPACED + 1)]
            tried = [{**current.values, key: written(number, each.unit)} for number in numbers]
            place = first_failing(tried)
            passing = [passing, *numbers][SPACED if place is None else place]

    keys: list[str] = []
    for _ in range(MOST_PASSES):
        before = current.values
        reset = [without(key) for key in current.values if key != section.smallest]
        while reset and first_failing(reset) is not None:
            reset = [without(key) for key in current.values if key != section.smallest]
        keys = [key for key in current.values if targets[key] is not None]
        for key in sorted(keys, key=lambda each: each != section.smallest):
            narrow(key, targets[key] or 0.0)
        if current.values == before:
            break
    for key in keys:
        if key != section.smallest:
            rounded = [_rounded(current.values[key], ranges[key], digits) for digits in (1, 2, 3)]
            first_failing([{**current.values, key: v} for v in rounded if v is not None])
    return current


def _target(graph: CheckedGraph, each: Range, section: Falsification) -> float | None:
    """Return the value that simplification moves a parameter to, in the unit of its range; ``None``
    if it is no single number."""
    if each.choices or not each.scalar:
        return None
    if each.key == section.smallest:
        return each.bounds[0][0]
    return nominal_number(graph, each)


def nominal_number(graph: CheckedGraph, each: Range) -> float | None:
    """Return the number that the graph gives a parameter, in the unit of its range; ``None`` if it
    gives none."""
    path, *names = each.key.split(".")
    value: Any = next((spec.params for spec in graph.blocks if spec.path == path), None)
    unit = ""
    for name in names:
        if isinstance(value, BaseModel):
            info = type(value).model_fields.get(name)
            unit = (unit_of(info) if info is not None else "") or unit
            value = getattr(value, name, None)
        else:
            value = value.get(name) if isinstance(value, Mapping) else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    if not each.unit or not unit:
        return float(value)
    try:
        return float(value) * parse_unit(unit).factor_to(parse_unit(each.unit))
    except UnitError:
        return None


def _rounded(value: Any, each: Range, digits: int) -> Any:
    """Round the value to so many digits; ``None`` if that is outside of the range."""
    number = in_unit(value, each.unit)
    assert number is not None
    short = float(f"{number:.{digits}g}")
    low, high = each.bounds[0]
    return written(short, each.unit) if low <= short <= high else None


def graph_text(study: Study, found: Attempt, folder: Path) -> str:
    """Write the failing run as a graph of a few lines.

    Args:
        study: the study.
        found: the attempt; its worst run is written.
        folder: where the file is to be, which its paths are relative to.
    """
    cell, outcome = found.worst.cell, found.worst.outcome
    assert outcome is not None
    files = [os.path.relpath(file, folder) for file in (*cell.include, cell.graph, *cell.behind)]
    graph = load_cell(cell.graph, cell.include, cell.sets, cell.origin, cell.behind)
    seeds = dict.fromkeys(graph.seed_parameters, found.worst.seed)
    command = os.path.relpath(study.path, folder)
    lines = [
        f"# Found by `aloft falsify {command}`: {outcome.reason}",
        f"include: {text_of([Path(file).as_posix() for file in files])}",
        "set:",
        *(f"  {key}: {text_of(value)}" for key, value in {**cell.overrides, **seeds}.items()),
    ]
    return "\n".join(lines) + "\n"


TEST = '''"""A run that `aloft falsify` found to fail: {reason}"""

from pathlib import Path

import aloft


def test_{name}() -> None:
    graph = aloft.load(Path(__file__).with_name("{file}"))
    result = graph.run(log=False)
    assert result.success, result.reason
'''


def keep(text: str, reason: str, path: Path) -> tuple[Path, Path]:
    """Write a graph and the test that it succeeds, which fails until what was found is mended.

    Args:
        text: of ``graph_text`` for the folder of the test.
        reason: why the run fails.
        path: the test's file, with a name that pytest finds; the graph is beside it, without ``test_``.

    Raises:
        AloftError: the path is of another form, one of the files exists, or cannot be written.
    """
    name = path.stem.removeprefix("test_")
    if path.suffix != ".py" or not path.stem.startswith("test_") or not name.isidentifier():
        raise AloftError(f"{path}: expected a name that pytest finds, such as test_push.py")
    graph = path.with_name(f"{name}.yaml")
    for file in (path, graph):
        if file.exists():
            raise AloftError(f"{file} is there already; give another name with --test")
    quoted = reason.replace("\\", "/").replace('"', "'")
    test = TEST.format(reason=quoted, name=name, file=graph.name)
    for file, content in ((graph, text), (path, test)):
        try:
            file.write_text(content, encoding="utf-8")
        except OSError as error:
            raise AloftError(f"cannot write {file}: {error.strerror or error}") from error
    return path, graph
