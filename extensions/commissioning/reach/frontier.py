"""The frontier: the reach of jumps that land at 95 % in every direction, against that of the motors.

Along each of a robot's directions three ends are looked for on one ladder of values:

- **planned**: the last rung for which the planner finds a valid plan with its usual recipe, by
  strides and bisection (``search.furthest``);
- **reached**: the largest rung, walking from rung to rung, of whose runs in the graph's trial at least
  95 % land (``blocks.JumpScore``); the walk ends after two failing rungs in a row. A quick effort
  looks for it by bisection;
- **theory**: the last rung for which the planner finds a valid plan with ``directions.LOOSEST``, each
  solve started from the plan of the nearest rung below and, if that fails, from nothing. Flight and
  impact are exact as always, and the plan passes the same check by exact dynamics. It is what this
  planner can find, so a lower bound of what the motors could give; nothing is fed back.

What has been planned and run is kept in a folder and not done again unless the code or
the graph changes; more seeds go on from there.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from ....robots.description import find_robot
from ....runtime.graph import load
from ....studies.batch.jobs import job_results
from ....studies.journal import Journal, Outcome, code_fingerprint
from ....studies.summary import wilson_interval
from .directions import Direction
from .search import (
    Ask,
    Effort,
    JumpGraph,
    PlanJob,
    RunJob,
    Tries,
    do,
    enough,
    explore,
    of_runs,
    required,
)

MOST_NAMED = 3
"""Largest number of binding limits that are named."""


def result_of(tries: Tries, runs: int) -> dict[str, Any]:
    """Return a direction's ends in the unit that people read, the reason why nothing further is
    reached, the binding limits of the plan at each end, and every rung that was run.

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
        "reached_ended": tries.reached_ended,
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
            "runs": _seconds(of_runs(tries)),
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


def _failed(tries: Tries, runs: int) -> dict[int, str]:
    """Return every rung that failed with its reason, in their order: the runs' most frequent one,
    or the obstacle to a plan."""
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
    """Return the reasons of runs that failed, most frequent first; those that differ in numbers
    only count as one, and the first of them is shown."""
    shown: dict[str, str] = {}
    count = Counter[str]()
    for outcome in outcomes:
        if not outcome.success:
            alike = re.sub(r"\d+(\.\d+)?", "#", outcome.reason)
            shown.setdefault(alike, outcome.reason)
            count[alike] += 1
    return [(shown[alike], times) for alike, times in count.most_common()]


def _shares(outcomes: list[Outcome] | None) -> list[int] | None:
    """Return the number of runs that landed, and of all."""
    return None if outcomes is None else [sum(run.success for run in outcomes), len(outcomes)]


def _binds(outcome: Outcome | None) -> str:
    names = [] if outcome is None else list(outcome.metrics.get("binds", ()))
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


def _refused(outcomes: dict[int, Outcome], end: int) -> str:
    """Return the planner's objection to the next rung that it tried above an end."""
    above = [rung for rung, outcome in outcomes.items() if rung > end and not outcome.success]
    return outcomes[min(above)].reason if above else ""


def _seconds(outcomes: Iterable[Outcome]) -> float:
    return round(sum(float(each.metrics.get("cpu_s", 0.0)) for each in outcomes), 2)


def frontier(
    graph: JumpGraph,
    directions: Sequence[Direction],
    seeds: Sequence[int],
    folder: Path,
    effort: Effort,
    *,
    workers: int = 0,
    progress: Callable[[str], None] = lambda _: None,
) -> list[dict[str, Any]]:
    """Return ``result_of`` every direction; plans and tries are kept in ``folder``.

    ``progress`` is told each try, and what came of it.
    """
    keys = _Keys(graph)
    walks = {d.name: Tries(d) for d in directions}
    searches = {name: explore(tries, effort) for name, tries in walks.items()}
    waiting = {name: next(search) for name, search in searches.items()}
    jobs = _Jobs()
    with Journal(folder / "runs.jsonl") as journal:

        def advance(name: str) -> None:
            """Go on along a direction, up to the next try that is not kept."""
            while name in waiting:
                tries, ask = walks[name], waiting[name]
                job = job_for(graph, tries.direction, ask, seeds, folder, journal, keys)
                if job is not None:
                    jobs.add(name, job)
                    return
                answer(tries, ask, seeds, journal, keys)
                progress(_told(tries, ask))
                try:
                    waiting[name] = next(searches[name])
                except StopIteration:
                    del waiting[name]

        for name in walks:
            advance(name)
        with closing(job_results(do, jobs, workers=workers)) as results:
            for result in results:
                name, job = jobs.given[result.index]
                keep(journal, keys, walks[name].direction, waiting[name], job, result)
                advance(name)
    return [result_of(tries, len(seeds)) for tries in walks.values()]


class _Jobs:
    """The jobs that can begin, of which there are more each time one is done: no direction waits for another, and
    the processes, which take seconds to begin, go on to the end."""

    def __init__(self) -> None:
        self.given: list[tuple[str, PlanJob | RunJob]] = []
        self._begun = 0

    def add(self, name: str, job: PlanJob | RunJob) -> None:
        """Add a job along the direction of that name."""
        self.given.append((name, job))

    def __iter__(self) -> Iterator[PlanJob | RunJob]:
        return self

    def __next__(self) -> PlanJob | RunJob:
        if self._begun == len(self.given):
            raise StopIteration  # for now
        self._begun += 1
        return self.given[self._begun - 1][1]


def _told(tries: Tries, ask: Ask) -> str:
    """Describe a try and its outcome in a line."""
    way = tries.direction
    what = f"{way.name} {way.value(ask.rung):g} {way.unit}"
    if ask.kind == "run":
        runs = tries.runs[ask.rung]
        return f"{what}: {sum(run.success for run in runs)} of {len(runs)} land"
    found = (tries.recipe if ask.kind == "recipe" else tries.loosest)[ask.rung]
    limits = "" if ask.kind == "recipe" else ", all of the motors and no margins"
    return f"{what}{limits}: {'a plan' if found.success else f'no plan ({found.reason})'}"


class _Keys:
    """The keys of kept outcomes: code and graph, then the task by its hash."""

    def __init__(self, graph: JumpGraph) -> None:
        text = f"{code_fingerprint()}\n{load(graph.path, graph.settings).checked.text}"
        self.code = hashlib.sha256(text.encode()).hexdigest()[:24]
        self._robot = find_robot(graph.robot)
        self._hashes: dict[tuple[str, bool, int], str] = {}

    def __call__(self, way: Direction, ask: Ask, seed: int | None = None) -> str:
        loosest = ask.kind == "loosest"
        place = (way.name, loosest, ask.rung)
        if place not in self._hashes:
            task = way.loosest(ask.rung) if loosest else way.task(ask.rung)
            self._hashes[place] = task.hash(self._robot)
        whole = f"{self.code}:{self._hashes[place]}"
        return whole if seed is None else f"{whole}:{seed}"


def _known(way: Direction, ask: Ask, seeds: Sequence[int], journal: Journal,
           keys: _Keys) -> list[Outcome]:  # fmt: skip
    """Return the kept runs of a rung in the order of the seeds, up to where there are enough."""
    found = list[Outcome]()
    for seed in seeds:
        failed = sum(not each.success for each in found)
        outcome = journal.outcomes.get(keys(way, ask, seed))
        if outcome is None or enough(len(found), failed, len(seeds)):
            break
        found.append(outcome)
    return found


def job_for(graph: JumpGraph, way: Direction, ask: Ask, seeds: Sequence[int], folder: Path,
            journal: Journal, keys: _Keys) -> PlanJob | RunJob | None:  # fmt: skip
    """Return the job that is left of a try; ``None`` if all of it is kept."""
    plans = folder / "plans"
    if ask.kind != "run":
        if keys(way, ask) in journal.outcomes:
            return None
        task = way.loosest(ask.rung) if ask.kind == "loosest" else way.task(ask.rung)
        return PlanJob(graph.robot, task, plans, ask.near)
    known = _known(way, ask, seeds, journal, keys)
    done, failed = len(known), sum(not each.success for each in known)
    if enough(done, failed, len(seeds)):
        return None
    return RunJob(graph, way.task(ask.rung), plans, tuple(seeds[done:]), len(seeds), done, failed)


def keep(journal: Journal, keys: _Keys, way: Direction, ask: Ask, job: PlanJob | RunJob,
         result: Any) -> None:  # fmt: skip
    """Keep what a job found; what broke is a failure, told with its error."""
    if isinstance(job, PlanJob):
        journal.add(keys(way, ask), result.value or Outcome(False, f"broke: {result.error}"))
        return
    broke = Outcome(False, f"broke: {result.error}", error=result.error)
    for seed, outcome in result.value or [(seed, broke) for seed in job.seeds]:
        journal.add(keys(way, ask, seed), outcome)


def answer(tries: Tries, ask: Ask, seeds: Sequence[int], journal: Journal, keys: _Keys) -> None:
    """Put what is kept of a try where the search looks for it."""
    if ask.kind == "run":
        tries.runs[ask.rung] = _known(tries.direction, ask, seeds, journal, keys)
    else:
        outcomes = tries.recipe if ask.kind == "recipe" else tries.loosest
        outcomes[ask.rung] = journal.outcomes[keys(tries.direction, ask)]
