"""The frontier: how far jumps in every direction land at 95 %, against what the motors could give.

Along each of ``directions.DIRECTIONS`` three ends are looked for on one ladder of values:

- **planned**: the last rung for which the planner finds a valid plan with its usual recipe, by
  strides and bisection (``ladders.furthest``);
- **reached**: the largest rung, walking from rung to rung, of whose runs in the robust trial at least
  95 % land (``blocks.JumpScore``); the walk ends after two failing rungs in a row;
- **theory**: the last rung for which the planner finds a valid plan with ``directions.LOOSEST``, each
  solve started from the plan of the nearest rung below and, if that fails, from nothing. Flight and
  impact are exact as always, and the plan passes the same check by exact dynamics. It is what this
  planner can find, so a lower bound of what the motors could give; nothing is fed back.

What has been planned and run is kept in ``results/frontier`` and not done again unless the code or
the graph changes; more seeds go on from there.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from ...planner.library.library import shipped_folder
from ...robots.description import find_robot
from ...studies.batch.jobs import job_results
from ...studies.expansion import load_cell
from ...studies.journal import Journal, Outcome, code_fingerprint
from ..rows import Row
from .chart import frontier_chart
from .directions import DIRECTIONS, Direction
from .jobs import RATE, PlanJob, RunJob, do, enough
from .result import result_of, row_of
from .search import Ask, Tries, explore

SEEDS = tuple(range(9000, 9020))
"""Nothing is tuned on them."""
FOLDER = Path("results") / "frontier"


def frontier(
    seeds: Sequence[int] = SEEDS,
    folder: Path = FOLDER,
    directions: Sequence[Direction] = DIRECTIONS,
) -> list[Row]:
    """One row a direction; writes ``frontier.json`` and ``frontier.svg`` into ``folder``."""
    keys = _Keys()
    walks = {d.name: Tries(d) for d in directions}
    searches = {name: explore(tries, len(seeds)) for name, tries in walks.items()}
    waiting = {name: next(search) for name, search in searches.items()}
    with Journal(folder / "runs.jsonl") as journal:
        while waiting:
            names, jobs = list[str](), list[PlanJob | RunJob]()
            for name in list(waiting):
                while name in waiting:
                    tries, ask = walks[name], waiting[name]
                    job = job_for(tries.direction, ask, seeds, folder, journal, keys)
                    if job is not None:
                        names.append(name)
                        jobs.append(job)
                        break
                    answer(tries, ask, seeds, journal, keys)
                    try:
                        waiting[name] = next(searches[name])
                    except StopIteration:
                        del waiting[name]
            with closing(job_results(do, jobs)) as results:
                for result in results:
                    tries = walks[names[result.index]]
                    ask = waiting[names[result.index]]
                    keep(journal, keys, tries.direction, ask, jobs[result.index], result)
    told = [result_of(tries, len(seeds)) for tries in walks.values()]
    found = {"seeds": list(seeds), "rate": RATE, "code": keys.code, "directions": told}
    text = json.dumps(found, indent=1, allow_nan=False) + "\n"
    (folder / "frontier.json").write_text(text, encoding="utf-8")
    (folder / "frontier.svg").write_text(frontier_chart(told), encoding="utf-8")
    return [row_of(each) for each in told]


class _Keys:
    """What outcomes are kept under: code and graph, then the task by its hash."""

    def __init__(self) -> None:
        graphs = shipped_folder()
        trial = graphs / "trials" / "robust.yaml"
        graph = load_cell(graphs / "jump.yaml", [trial], {}, graphs / "bench.yaml")
        text = f"{code_fingerprint()}\n{graph.checked.text}"
        self.code = hashlib.sha256(text.encode()).hexdigest()[:24]
        self._robot = find_robot("bruce")
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
    """The kept runs of a rung in the order of the seeds, up to where there are enough."""
    found = list[Outcome]()
    for seed in seeds:
        failed = sum(not each.success for each in found)
        outcome = journal.outcomes.get(keys(way, ask, seed))
        if outcome is None or enough(len(found), failed, len(seeds)):
            break
        found.append(outcome)
    return found


def job_for(way: Direction, ask: Ask, seeds: Sequence[int], folder: Path, journal: Journal,
            keys: _Keys) -> PlanJob | RunJob | None:  # fmt: skip
    """What is still to be done for a try; ``None`` if all of it is kept."""
    if ask.kind != "run":
        if keys(way, ask) in journal.outcomes:
            return None
        task = way.loosest(ask.rung) if ask.kind == "loosest" else way.task(ask.rung)
        return PlanJob(task, folder / "plans", ask.near)
    known = _known(way, ask, seeds, journal, keys)
    done, failed = len(known), sum(not each.success for each in known)
    if enough(done, failed, len(seeds)):
        return None
    missing = tuple(seeds[done:])
    return RunJob(way.task(ask.rung), folder / "plans", missing, len(seeds), done, failed)


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
