"""The frontier: how far jumps in every direction land at 95 %, against what the motors could give.

Along each of ``search.DIRECTIONS`` three ends are looked for on one ladder of values:

- **planned**: the last rung for which the planner finds a valid plan with its usual recipe, by
  strides and bisection (``search.furthest``);
- **reached**: the largest rung, walking from rung to rung, of whose runs in the robust trial at least
  95 % land (``blocks.JumpScore``); the walk ends after two failing rungs in a row;
- **theory**: the last rung for which the planner finds a valid plan with ``search.LOOSEST``, each
  solve started from the plan of the nearest rung below and, if that fails, from nothing. Flight and
  impact are exact as always, and the plan passes the same check by exact dynamics. It is what this
  planner can find, so a lower bound of what the motors could give; nothing is fed back.

What has been planned and run is kept in ``results/frontier`` and not done again unless the code or
the graph changes; more seeds go on from there.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from ...planner.library.library import shipped_folder
from ...plotting import COLOURS, FAINT, INK, PALE, new_figure, style, svg_text
from ...robots.description import find_robot
from ...studies.batch.jobs import job_results
from ...studies.expansion import load_cell
from ...studies.journal import Journal, Outcome, code_fingerprint
from ...studies.summary import wilson_interval
from ..rows import Row
from .search import (
    DIRECTIONS,
    RATE,
    Ask,
    Direction,
    PlanJob,
    RunJob,
    Tries,
    do,
    enough,
    explore,
    required,
)

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


KINDS = (
    ("theory", "theory: full motors, no margins", PALE, 0.78),
    ("planned", "planned by the recipe", COLOURS[5], 0.46),
    ("reached", "lands at 95 %", COLOURS[0], 0.22),
)
"""What the bars show, from the widest to the narrowest: key, label, colour and width."""


def frontier_chart(found: Sequence[Mapping[str, Any]]) -> str:
    """The chart as SVG text: one row a direction, the first at the top, its bars as shares of the
    theoretical bound, and the values beside them."""
    from matplotlib.ticker import PercentFormatter

    with style():
        figure = new_figure(9.0, 1.5 + 0.42 * max(len(found), 1), "How far jumps reach")
        axes = figure.add_subplot()
        axes.grid(axis="y", visible=False)
        for key, label, colour, width in KINDS:
            shares = [each[key] / each["theory"] if each["theory"] else 0.0 for each in found]
            bars = axes.barh(range(len(found)), shares, width, color=colour, label=label)
            for row, bar in enumerate(bars):
                bar.set_gid(f"{key}-{row}")
        for row, each in enumerate(found):
            more = "" if each["theory_ended"] else " or more"
            values = " / ".join(f"{each[key]:g}" for key in ("reached", "planned", "theory"))
            axes.annotate(
                f"{values}{more} {each['unit']}", (1.0, row), (8, 0),
                xycoords=axes.get_yaxis_transform(), textcoords="offset points", va="center",
                fontsize=8, color=FAINT,
            )  # fmt: skip
        axes.set_yticks(range(len(found)), [each["name"] for each in found], color=INK)
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        axes.set_ylim(len(found) - 0.4, -0.6)
        axes.set_xlim(0.0, 1.0)
        axes.xaxis.set_major_formatter(PercentFormatter(1.0, 0))
        axes.set_xlabel("share of the theoretical bound; values: reached / planned / theory")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=8)
        return svg_text(figure)


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
