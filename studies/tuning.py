"""Search for the gains of every arm with Optuna, with the same effort for each.

::

    landing.w_k: [0, 0.5]                   # one number, uniform
    landing.w_l: [[0, 0.1], [0, 0.1]]       # a vector, each number for itself
    wbc.thrust.torso_weight: {from: 1.0e-3, to: 10, log: true}
    landing.law: {choices: [paper, deviation]}

Every arm gets the same number of draws, and every draw the same cells and seeds. Draw 0 is the arm
as it is written, so tuning never ends below it. Optuna's tree-structured Parzen estimator proposes
the others, a few at a time for every arm, from the results of those before, so that all processors
have work (Bergstra, Bardenet, Bengio and Kegl, Algorithms for Hyper-Parameter Optimization, NIPS
2011). The best draw is the one with the most successes. Among equals it is the one with the least
mean of the metric ``least``, and then the first one. An arm without ranges is not changed.

The number of draws that are proposed at once is fixed, and the sampler is seeded by the study's
``tune.seed`` and the arm's name: what is proposed depends neither on the number of processors nor on
another arm. So a search that was stopped goes on where it was, because it proposes the same again
and finds those runs in its journal.

With ``race`` the runs of a draw are made one by one, every cell with the first seed, then with the next, and a draw that
has failed more often than the best one before it is stopped, as it can no longer win. The sampler is told its rate of failures.

The result is a file beside the study's file, from which the study's runs take the parameters. It
holds a hash of what was searched: a study that was changed since has to be tuned again.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files.document import read_file
from ..files.nodes import Entry, ListNode, MapNode, Node, ScalarNode, plain, text_of
from ..files.pip_line import pip_line
from ..files.problems import Code, LoadError, Position, Problems
from ..runtime.language.errors import AloftError
from ..runtime.loading.reading.written import unknown_key
from .execution import Run
from .expansion import Cell, Tuned, cells
from .quantities import in_unit, quantity, written
from .study import Range, Study

if TYPE_CHECKING:
    from optuna import Study as OptunaStudy
    from optuna import Trial


EXPECTED = "[low, high], [[low, high], ...], {from:, to:, log: true} or {choices: [...]}"


def read_range(entry: Entry, problems: Problems) -> Range | None:
    """Read the range of one parameter; ``None`` if it is wrong, which is noted as a problem."""
    node = entry.value
    if isinstance(node, MapNode):
        choices = node.get("choices")
        legal = ("choices",) if choices else ("from", "to", "log")
        for item in node:
            if item.key not in legal:
                unknown_key(item, ("from", "to", "log", "choices"), "of a range", problems)
                return None
        if choices is not None:
            if isinstance(choices.value, ListNode) and choices.value.items:
                return Range(entry.key, entry.key_where, choices=tuple(plain(choices.value)))
            return _refuse(entry, node, problems)
        low, high = node.get("from"), node.get("to")
        log = node.get("log")
        if low is None or high is None or (log and not isinstance(plain(log.value), bool)):
            return _refuse(entry, node, problems)
        scalar = not isinstance(low.value, ListNode)
        lows = [plain(low.value)] if scalar else plain(low.value)
        highs = [plain(high.value)] if scalar else plain(high.value)
        return _bounds(entry, lows, highs, scalar, bool(log and plain(log.value)), problems)
    if not isinstance(node, ListNode) or len(node.items) < 1:
        return _refuse(entry, node, problems)
    if all(isinstance(item, ListNode) and len(item.items) == 2 for item in node.items):
        pairs = plain(node)
        return _bounds(entry, [p[0] for p in pairs], [p[1] for p in pairs], False, False, problems)
    if len(node.items) == 2 and all(isinstance(item, ScalarNode) for item in node.items):
        low_value, high_value = plain(node)
        return _bounds(entry, [low_value], [high_value], True, False, problems)
    return _refuse(entry, node, problems)


def _bounds(
    entry: Entry, lows: Any, highs: Any, scalar: bool, log: bool, problems: Problems
) -> Range | None:
    if not isinstance(highs, list) or len(lows) != len(highs) or not lows:
        return _refuse(entry, entry.value, problems)
    unit = next((found[1] for v in (*lows, *highs) if (found := quantity(v)) and found[1]), "")
    bounds = []
    for low_value, high_value in zip(lows, highs, strict=True):
        low, high = in_unit(low_value, unit), in_unit(high_value, unit)
        if low is None or high is None or not low <= high or (log and low <= 0):
            return _refuse(entry, entry.value, problems, log)
        bounds.append((low, high))
    return Range(entry.key, entry.key_where, tuple(bounds), scalar, unit, log)


def _refuse(entry: Entry, node: Node, problems: Problems, log: bool = False) -> Range | None:
    low = "numbers above zero, low before high" if log else "low before high"
    problems.add(
        Code.BAD_VALUE,
        f"{text_of(plain(node))} is no range for {entry.key}",
        node.where,
        at=entry.key,
        expected=f"{EXPECTED}, {low}",
    )
    return None


def value_at(found: Range, shares: Sequence[float]) -> Any:
    """Return the value at a share, from 0 to 1, of each of its numbers' ranges."""
    values = []
    for (low, high), share in zip(found.bounds, shares, strict=True):
        if found.log:
            number = math.exp(math.log(low) + share * (math.log(high) - math.log(low)))
        else:
            number = low + share * (high - low)
        # four digits: what was found can be read, copied and said
        values.append(written(min(max(float(f"{number:.4g}"), low), high), found.unit))
    return values[0] if found.scalar else values


def corners(found: Range) -> tuple[Any, ...]:
    """Return the values at the ends of the range, with which every graph is checked before tuning."""
    if found.choices:
        return found.choices
    ends = [[written(pair[end], found.unit) for pair in found.bounds] for end in (0, 1)]
    return tuple(end[0] if found.scalar else end for end in ends)


@dataclass(frozen=True)
class Draw:
    """One set of parameters of an arm, and the results of its runs."""

    number: int
    values: Mapping[str, Any]
    n: int = 0
    successes: int = 0
    least: float = math.nan
    """The mean of the metric that should be least; NaN where no run has it, or none is named."""
    stopped: bool = False
    """True if runs of it were left out, because it could no longer win."""


def tuning_cells(study: Study) -> list[Cell]:
    """Return the cells that every draw of an arm is tried on, as they are written."""
    assert study.tuning is not None
    tuning = study.tuning
    expanded = cells(study, common=tuning.sets)
    return [cell for cell in expanded if tuning.cells.takes(cell.labels)]


def extreme_cells(study: Study, chosen: Sequence[Cell]) -> list[Cell]:
    """Return cells with every range of tuning at its ends. They are checked before anything runs."""
    found = []
    for arm in study.arms:
        first = next((cell for cell in chosen if cell.arm == arm.name), None)
        found += cells_at_ends(first, arm.ranges) if first else []
    return found


def cells_at_ends(cell: Cell, ranges: Sequence[Range]) -> list[Cell]:
    """Return the cell with each of the ranges at its ends."""
    return [cell.with_sets({each.key: e}, each.where) for each in ranges for e in corners(each)]


def draw_runs(
    values: Mapping[str, Any], where: str, mine: Sequence[Cell], seeds: Sequence[int]
) -> list[Run]:
    """Return the runs of one set of parameters on checked cells; ``where`` names it in errors."""
    found = []
    for cell in mine:
        tried = replace(cell.with_sets(values, Position(where, 0, 0)), base=cell.sets)
        if values:
            text = f"{cell.key} {text_of(dict(values))}"
            tried = replace(tried, key=hashlib.sha256(text.encode()).hexdigest()[:24])
        found += [Run(tried, seed) for seed in seeds]
    return found


def order(found: Draw) -> tuple[float, float, int]:
    """Return the sorting key of a draw: the least is the best."""
    least = math.inf if math.isnan(found.least) else found.least
    return -found.successes, least, found.number


def scored(found: Draw, runs: Sequence[Run], least: str) -> Draw:
    """Score the draw by the results of its runs."""
    outcomes = [run.outcome for run in runs if run.outcome is not None]
    values = [float(o.metrics[least]) for o in outcomes if o.metrics.get(least) is not None]
    mean = math.fsum(values) / len(values) if values else math.nan
    successes = sum(outcome.success for outcome in outcomes)
    return Draw(found.number, found.values, len(outcomes), successes, mean)


def tuned_path(study: Study) -> Path:
    """Return the path of the file with the tuned parameters, beside the study's file."""
    return study.path.with_name(f"{study.path.stem}.tuned.yaml")


def definition(study: Study) -> str:
    """Hash everything that defines the search: the cells, the ranges, the seeds and the draws."""
    assert study.tuning is not None
    tuning = study.tuning
    searched: list[Any] = [list(tuning.seeds), tuning.draws, tuning.seed, tuning.least]
    searched += ["race"] if tuning.race else []
    searched += [path.name for path in study.include]
    searched += [[arm.name, path.name] for arm in study.arms for path in arm.include]
    searched += [[c.task, c.graph.name, c.arm, c.overrides] for c in tuning_cells(study)]
    searched += [
        [arm.name, each.key, each.unit, each.log, *map(list, each.bounds), *each.choices]
        for arm in study.arms
        for each in arm.ranges
    ]
    return hashlib.sha256(text_of(searched).encode()).hexdigest()[:16]


def write_tuned(study: Study, best: Mapping[str, Draw], stopped: Mapping[str, int]) -> Path:
    """Write the best parameters of every arm, and how many of its draws were stopped. Raises ``AloftError``."""
    assert study.tuning is not None
    tuning = study.tuning
    lines = [
        f"# What `aloft tune {study.path.name}` found; its runs take it from here.",
        f"definition: {text_of(definition(study))}",
        f"seeds: {text_of(list(tuning.seeds))}",
        f"draws_per_arm: {tuning.draws}",
        "arms:",
    ]
    for arm, found in best.items():
        score = f"draw: {found.number}, successes: {found.successes}, n: {found.n}"
        if tuning.race:
            score += f", stopped: {stopped.get(arm, 0)}"
        lines.append(f"  {text_of(arm)}: {{{score}, set: {text_of(dict(found.values))}}}")
    path = tuned_path(study)
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_text("\n".join(lines) + "\n", encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        raise AloftError(f"cannot write {path}: {error.strerror or error}") from error
    return path


def read_tuned(study: Study) -> Tuned:
    """Read the tuned parameters of every arm; empty for a study without a section ``tune``.

    Raises:
        AloftError: the study has not been tuned, or has been changed since.
        LoadError: the file is not what ``write_tuned`` writes.
    """
    if study.tuning is None:
        return {}
    path = tuned_path(study)
    fix = f"aloft tune {study.path}"
    if not path.is_file():
        raise AloftError(f"{study.path} has not been tuned: there is no {path}; run {fix}")
    problems = Problems()
    tree = read_file(path, str(path), problems, ("a file of tuned parameters", "arms"))
    if tree is None:
        raise LoadError(problems.report(str(path)))
    data = plain(tree)
    if data.get("definition") != definition(study):
        raise AloftError(
            f"{path} was found for another {study.path}: what is tuned, or on what, has changed "
            f"since; run {fix}"
        )
    try:
        return {arm.name: dict(data["arms"][arm.name]["set"]) for arm in study.arms}
    except (KeyError, TypeError) as error:
        raise AloftError(f"{path} does not have all arms; run {fix}") from error


AT_ONCE = 8
"""Draws of an arm that are proposed before the first of their results is known."""
Make = Callable[[Sequence[Run]], list[Run]]
"""Makes runs."""


def runs_of_search(study: Study, chosen: Sequence[Cell]) -> int:
    """Return the number of runs that the search takes on these cells."""
    assert study.tuning is not None
    draws = {arm.name: study.tuning.draws if arm.ranges else 1 for arm in study.arms}
    return sum(draws[cell.arm] for cell in chosen) * len(study.tuning.seeds)


def search(
    study: Study,
    chosen: Sequence[Cell],
    make: Make,
    on_draw: Callable[[str, Draw], None] = lambda arm, found: None,
) -> dict[str, Draw]:
    """Search for the best draw of every arm.

    Args:
        study: the study, with a section ``tune``.
        chosen: its cells for tuning, checked.
        make: makes the runs of some draws of all arms.
        on_draw: called with the arm and each of its draws once its runs are made.

    Raises:
        AloftError: Optuna is not installed.
    """
    assert study.tuning is not None
    tuning = study.tuning
    arms = {arm.name: arm for arm in study.arms if any(c.arm == arm.name for c in chosen)}
    own_cells = {name: [cell for cell in chosen if cell.arm == name] for name in arms}
    samplers = {
        name: optuna_study("tune", f"{tuning.seed} {name}")
        for name, arm in arms.items()
        if arm.ranges
    }
    best: dict[str, Draw] = {}
    for first in (0, *range(1, tuning.draws, AT_ONCE)):
        asked: list[tuple[str, Draw, Trial | None]] = []
        for name, arm in arms.items():
            if first == 0:
                asked.append((name, Draw(0, {}), None))  # as it is written
            elif arm.ranges:
                for number in range(first, min(first + AT_ONCE, tuning.draws)):
                    trial = samplers[name].ask()
                    values = {each.key: proposed(each, trial) for each in arm.ranges}
                    asked.append((name, Draw(number, values), trial))
        planned = [
            draw_runs(
                each.values, f"draw {each.number} of arm {name}", own_cells[name], tuning.seeds
            )
            for name, each, _ in asked
        ]
        allowed = [
            len(runs) - best[name].successes if tuning.race and name in best else len(runs)
            for (name, _, _), runs in zip(asked, planned, strict=True)
        ]
        made = (
            made_in_rounds(planned, allowed, make) if tuning.race else made_at_once(planned, make)
        )
        for (name, each, drawn), runs, done in zip(asked, planned, made, strict=True):
            found = replace(scored(each, done, tuning.least), stopped=len(done) < len(runs))
            on_draw(name, found)
            if drawn is not None:
                samplers[name].tell(drawn, value_to_minimise(found, len(runs)))
            if name not in best or order(found) < order(best[name]):
                best[name] = found
    return best


def made_at_once(planned: Sequence[Sequence[Run]], make: Make) -> list[list[Run]]:
    """Make the runs of some draws, all of them together."""
    done = iter(make([run for runs in planned for run in runs]))
    return [[next(done) for _ in runs] for runs in planned]


def made_in_rounds(
    planned: Sequence[Sequence[Run]], allowed: Sequence[int], make: Make
) -> list[list[Run]]:
    """Make the runs of some draws, one of every draw at a time, of each as long as no more of them failed than ``allowed``."""
    left = [sorted(runs, key=lambda run: run.seed) for runs in planned]
    done: list[list[Run]] = [[] for _ in planned]
    failures = [0] * len(planned)
    while live := [i for i, runs in enumerate(left) if runs and failures[i] <= allowed[i]]:
        for i, run in zip(live, make([left[i].pop(0) for i in live]), strict=True):
            done[i].append(run)
            failures[i] += not (run.outcome and run.outcome.success)
    return done


def value_to_minimise(found: Draw, runs: int) -> float:
    """Compute one number that orders draws as ``order`` does: failures, those of a stopped draw by their rate, then the
    metric, in (0, 1)."""
    share = 1.0 if math.isnan(found.least) else 0.5 + math.atan(found.least) / math.pi
    return (found.n - found.successes) * runs / found.n + share if found.n else runs + share


def proposed(each: Range, trial: Trial) -> Any:
    """Return the value of a range that a trial proposes."""
    if each.choices:
        return each.choices[trial.suggest_categorical(each.key, list(range(len(each.choices))))]
    shares = [trial.suggest_float(f"{each.key} {i}", 0.0, 1.0) for i in range(len(each.bounds))]
    return value_at(each, shares)


def optuna_study(verb: str, seed: str, *, random: bool = False) -> OptunaStudy:
    """Return a study that proposes draws: by a tree-structured Parzen estimator, or for comparison
    at random.

    Args:
        verb: the verb that needs it.
        seed: a text that determines what is proposed.
        random: whether results do not count.

    Raises:
        AloftError: Optuna is not installed.
    """
    try:
        import optuna
    except ImportError:
        raise AloftError(f"aloft {verb} needs Optuna: {pip_line('tune')}") from None
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    number = int.from_bytes(hashlib.sha256(seed.encode()).digest()[:4], "big")
    if random:
        return optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=number))
    return optuna.create_study(sampler=optuna.samplers.TPESampler(seed=number, constant_liar=True))
