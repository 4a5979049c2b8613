"""What the frontier's search found along a direction, as plain data and as a benchmark's row."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from typing import Any

from ...studies.journal import Outcome
from ...studies.summary import wilson_interval
from ..rows import Row
from .jobs import required
from .search import Tries

MOST_NAMED = 3
"""So many of the limits that bind are named at most."""


def result_of(tries: Tries, runs: int) -> dict[str, Any]:
    """A direction's ends in the unit that people read, why nothing further is reached, what binds
    in the plan at each end, and every rung that was run.

    ``reached``, ``planned`` and ``theory`` are 0 where nothing was found; ``fails_at`` is the next
    rung that was tried above ``reached``, ``none`` where there is none; ``gaps`` are rungs below
    ``reached`` that failed.
    """
    way = tries.direction
    failed = _failed(tries, runs)
    beyond = [rung for rung in failed if rung > tries.reached]
    fails_at = min(beyond, default=None)
    best = tries.runs.get(tries.reached, [])
    landed = sum(run.success for run in best)
    low, high = wilson_interval(landed, len(best)) if best else (0.0, 1.0)
    top = tries.loosest.get(tries.theory) or tries.recipe.get(tries.theory)
    return {
        "name": way.name,
        "what": way.what,
        "unit": way.unit,
        "reached": way.value(tries.reached),
        "landed": landed,
        "runs": len(best),
        "ci_low": low,
        "ci_high": high,
        "fails_at": None if fails_at is None else way.value(fails_at),
        "fails_landed": None if fails_at is None else _shares(tries.runs.get(fails_at)),
        "why": "" if fails_at is None else failed[fails_at],
        "gaps": [way.value(rung) for rung in failed if rung < tries.reached],
        "planned": way.value(tries.planned),
        "planned_ended": tries.planned_ended,
        "planned_binds": _binds(tries.recipe.get(tries.planned)),
        "refused": _refused(tries.recipe, tries.planned),
        "theory": way.value(tries.theory),
        "theory_ended": tries.theory_ended,
        "binds": _binds(top),
        "beyond": _refused(tries.loosest, tries.theory),
        "cpu_s": {
            "planned": _seconds(tries.recipe.values()),
            "theory": _seconds(tries.loosest.values()),
        },
        "rungs": [
            {
                "value": way.value(rung),
                "landed": sum(run.success for run in tries.runs[rung]),
                "runs": len(tries.runs[rung]),
                "reasons": dict(_reasons(tries.runs[rung])),
            }
            for rung in sorted(tries.runs)
        ],
    }


def row_of(found: dict[str, Any]) -> Row:
    """A direction's row: what is reached, its ratio to the theory, and what ends it."""
    note = f"planned {found['planned']:g}, theory {found['theory']:g}"
    note += f" ({found['binds']})" if found["binds"] else ""
    if found["runs"]:
        lands = f"{found['landed']} of {found['runs']} land"
        note = f"{lands}, 95 % interval {found['ci_low']:.2f} to {found['ci_high']:.2f}; {note}"
    if found["fails_at"] is not None:
        note += f"; {found['fails_at']:g} fails: {found['why']}"
    ratio = found["reached"] / found["theory"] if found["theory"] else None
    name = f"frontier, {found['name']}"
    return Row(name, found["reached"], found["unit"], "theory", ratio, note=note)


def _failed(tries: Tries, runs: int) -> dict[int, str]:
    """Every rung that failed and why, in their order: the runs' most frequent reason, or what kept
    the planner from a plan."""
    found = {
        rung: f"no plan: {outcome.reason}"
        for rung, outcome in tries.recipe.items()
        if not outcome.success
    }
    for rung, outcomes in tries.runs.items():
        if sum(run.success for run in outcomes) < required(runs):
            found[rung] = next(iter(_reasons(outcomes)))[0]
    return dict(sorted(found.items()))


def _reasons(outcomes: Iterable[Outcome]) -> list[tuple[str, int]]:
    """The reasons of runs that failed, most frequent first; those that differ in numbers only count
    as one, and the first of them is shown."""
    shown: dict[str, str] = {}
    count = Counter[str]()
    for outcome in outcomes:
        if not outcome.success:
            alike = re.sub(r"\d+(\.\d+)?", "#", outcome.reason)
            shown.setdefault(alike, outcome.reason)
            count[alike] += 1
    return [(shown[alike], times) for alike, times in count.most_common()]


def _shares(outcomes: list[Outcome] | None) -> list[int] | None:
    """How many of how many runs landed."""
    return None if outcomes is None else [sum(run.success for run in outcomes), len(outcomes)]


def _binds(outcome: Outcome | None) -> str:
    names = [] if outcome is None else list(outcome.metrics.get("binds", ()))
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


def _refused(outcomes: dict[int, Outcome], end: int) -> str:
    """What keeps the planner from the next rung that it tried above an end."""
    above = [rung for rung, outcome in outcomes.items() if rung > end and not outcome.success]
    return outcomes[min(above)].reason if above else ""


def _seconds(outcomes: Iterable[Outcome]) -> float:
    return round(sum(float(each.metrics.get("cpu_s", 0.0)) for each in outcomes), 2)
