"""Cost of a plan in the loop: processor time of random hops of BRUCE, from the request to the
checked table.

The requests are drawn uniformly within reach by a seed: straight ones ahead and back, those in all directions with
turns, and those up and down. Solving, the check and the table of the reference count; all of it is one thread. The first
plans of each kind, which load and compile, do not. A digest of all plans and tables tells whether two builds plan the
same bits.
"""

from __future__ import annotations

import hashlib

import numpy as np

from ....extensions.hopping.planner.hop_plans import (
    hop_table,
    level_reach,
    samples_of_hops,
    step_reach,
)
from ....extensions.hopping.planner.hop_request import HopRequest
from ....extensions.hopping.planner.next_hop import HopPlanner
from ....extensions.hopping.planner.plan_outcome import PlanOutcome
from ....planner.library.jump_table import table_rows
from ....planner.solving.solver_process import cpu_time
from ....planner.task.plan import ARRAYS
from ....robots.description import find_robot
from ..rows import Row

SEED = 32100
"""Seed of the requests; nothing is tuned on them."""
COUNT = 100
GOALS = {"straight": (0.02, 0.04), "all coordinates": (0.06, 0.12), "up and down": (0.06, 0.12)}
"""Processor time of a plan [s]: the median's and that of 99 %."""


def requests(kind: str, count: int = COUNT, seed: int = SEED) -> list[HopRequest]:
    """Draw the hops of a kind; they are the same on every machine."""
    rng, robot = np.random.default_rng(seed), find_robot("bruce")
    r, s = level_reach(robot), step_reach(robot)
    found = []
    for _ in range(count):
        ahead, aside = rng.uniform(-r.back, r.ahead), rng.uniform(-r.aside, r.aside)
        turn, up = rng.uniform(-r.turn, r.turn), rng.uniform(0.01, s.up)
        if kind == "straight":
            found.append(HopRequest(ahead, 0.0, 0.0))
        elif kind == "all coordinates":
            found.append(HopRequest(ahead, aside, turn))
        else:
            across, least = aside * s.aside / r.aside, s.least
            ahead = least + (s.ahead - least) * abs(ahead) / r.ahead
            found.append(
                HopRequest(ahead, across, turn * s.turn / r.turn, up if turn > 0.0 else -up)
            )
    return found  # fmt: skip


def online_plans(count: int = COUNT) -> list[Row]:
    """Measure for each kind the median and 99 % of processor time, and its parts."""
    robot = find_robot("bruce")
    planner = HopPlanner(robot, samples_of_hops(robot), samples_of_hops(robot, steps=True))
    planner.prepare()
    rows = []
    for kind, goals in GOALS.items():
        times, followed = [], dict.fromkeys(PlanOutcome, 0)
        bits = hashlib.blake2b(digest_size=8)
        for wanted in requests(kind, count):
            start = cpu_time()
            found = planner.plan(wanted)
            planned = cpu_time()
            table = hop_table(found.plan, robot)
            table_rows(table)
            end = cpu_time()
            for name in ARRAYS:
                bits.update(getattr(found.plan, name).tobytes())
            for column in table.columns.values():
                bits.update(column.tobytes())
            times.append((end - start, found.solve_s, found.check_s, end - planned))
            followed[found.outcome] += 1
        whole, *parts = np.median(times, axis=0)
        last = float(np.percentile([each[0] for each in times], 99))
        note = "{} {:.1f} ms, {} {:.1f}, {} {:.1f}; ".format(
            *(x for name, part in zip(("problem and steps", "check", "table"), parts, strict=True)
              for x in (name, 1e3 * part))
        ) + ", ".join(f"{n} {outcome.name.lower()}" for outcome, n in followed.items() if n)  # fmt: skip
        note += f"; digest {bits.hexdigest()}"
        rows.append(
            Row(f"plan in the loop, {kind}, median", float(whole), "s", goal=goals[0], note=note)
        )
        rows.append(
            Row(f"plan in the loop, {kind}, 99 %", last, "s", goal=goals[1], note=f"{count} hops")
        )
    return rows
