"""Search for the gains of every arm with Optuna, with the same effort for each.

It searches what ``tuning`` draws at random: the same ranges, cells, seeds and number of draws, and the
same order of draws. Optuna's tree-structured Parzen estimator proposes the draws, a few at a time
for every arm, from the results of those before, so that all processors have work. (Bergstra, Bardenet, Bengio
and Kegl, Algorithms for Hyper-Parameter Optimization, NIPS 2011.)

The number of draws that are proposed at once is fixed, and the sampler is seeded: what is proposed does
not depend on the number of processors. So a search that was stopped goes on where it was, because it
proposes the same again and finds those runs in its journal.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from ..runtime.language.errors import AloftError
from .execution import Run
from .expansion import Cell
from .study import Arm, Range, Study
from .tuning import Draw, draw_runs, order, scored, value_at

if TYPE_CHECKING:
    from optuna import Study as OptunaStudy
    from optuna import Trial

AT_ONCE = 8
"""Draws of an arm that are proposed before the first of their results is known."""
Make = Callable[[Sequence[Run]], "list[Run] | None"]
"""Makes runs; nothing comes back where it was stopped."""


def search(study: Study, chosen: Sequence[Cell], make: Make) -> dict[str, Draw] | None:
    """The best draw of every arm; ``None`` where ``make`` was stopped.

    Args:
        study: the study, with a section ``tune``.
        chosen: its cells for tuning, checked.
        make: makes the runs of some draws of all arms.

    Raises:
        AloftError: Optuna is not installed.
    """
    assert study.tuning is not None
    tuning = study.tuning
    arms = {arm.name: arm for arm in study.arms if any(c.arm == arm.name for c in chosen)}
    cells = {name: [cell for cell in chosen if cell.arm == name] for name in arms}
    samplers = {name: _optuna_study(tuning.seed, arm) for name, arm in arms.items() if arm.ranges}
    best: dict[str, Draw] = {}
    for first in (0, *range(1, tuning.draws, AT_ONCE)):
        asked: list[tuple[str, Draw, Trial | None]] = []
        for name, arm in arms.items():
            if first == 0:
                asked.append((name, Draw(0, {}), None))  # as it is written
            elif arm.ranges:
                for number in range(first, min(first + AT_ONCE, tuning.draws)):
                    trial = samplers[name].ask()
                    values = {each.key: _proposed(each, trial) for each in arm.ranges}
                    asked.append((name, Draw(number, values), trial))
        planned = [draw_runs(study, arms[name], each, cells[name]) for name, each, _ in asked]
        done = make([run for runs in planned for run in runs])
        if done is None:
            return None
        at = 0
        for (name, each, trial), runs in zip(asked, planned, strict=True):
            found = scored(each, done[at : at + len(runs)], tuning.least)
            at += len(runs)
            if trial is not None:
                samplers[name].tell(trial, value_to_minimise(found, len(runs)))
            if name not in best or order(found) < order(best[name]):
                best[name] = found
    return best


def value_to_minimise(found: Draw, runs: int) -> float:
    """One number that orders draws as ``order`` does: failures first, then the metric, in (0, 1)."""
    share = 1.0 if math.isnan(found.least) else 0.5 + math.atan(found.least) / math.pi
    return runs - found.successes + share


def _proposed(each: Range, trial: Trial) -> Any:
    if each.choices:
        return each.choices[trial.suggest_categorical(each.key, list(range(len(each.choices))))]
    shares = [trial.suggest_float(f"{each.key} {i}", 0.0, 1.0) for i in range(len(each.bounds))]
    return value_at(each, shares)


def _optuna_study(seed: int, arm: Arm) -> OptunaStudy:
    try:
        import optuna
    except ImportError:
        raise AloftError("aloft tune needs Optuna: pip install 'aloft[tune]'") from None
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    name = int.from_bytes(hashlib.sha256(f"{seed} {arm.name}".encode()).digest()[:4], "big")
    sampler = optuna.samplers.TPESampler(seed=name, constant_liar=True)
    return optuna.create_study(sampler=sampler)
