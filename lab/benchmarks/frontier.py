"""Reach of BRUCE's jumps in every direction, beside the reach that its motors allow."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...extensions.commissioning.reach.charts import frontier_chart
from ...extensions.commissioning.reach.directions import DIRECTIONS, Direction
from ...extensions.commissioning.reach.frontier import frontier as find_frontier
from ...extensions.commissioning.reach.search import FIRST_LOOK, RATE, Effort
from .jumps.jumps import bruce_jumps
from .rows import Row

SEEDS = tuple(range(9000, 9020))
"""Nothing is tuned on them."""
FOLDER = Path("results") / "frontier"
MOST_CPU, FIRST_LOOK_CPU = 90.0, 15.0
"""Processor time after which a search along one direction begins no further solve [s]; the
second with fewer runs a rung than ``FIRST_LOOK``."""


def frontier(
    seeds: Sequence[int] = SEEDS,
    folder: Path = FOLDER,
    directions: Sequence[Direction] = DIRECTIONS,
) -> list[Row]:
    """Measure one row a direction; write ``frontier.json`` and ``frontier.svg`` into ``folder``."""
    cpu = MOST_CPU if len(seeds) >= FIRST_LOOK else FIRST_LOOK_CPU
    effort = Effort(len(seeds), cpu, cpu)
    told = find_frontier(bruce_jumps(), directions, seeds, folder, effort)
    found = {"seeds": list(seeds), "rate": RATE, "directions": told}
    text = json.dumps(found, indent=1, allow_nan=False) + "\n"
    (folder / "frontier.json").write_text(text, encoding="utf-8")
    (folder / "frontier.svg").write_text(frontier_chart(told), encoding="utf-8")
    return [row_of(each) for each in told]


def row_of(found: dict[str, Any]) -> Row:
    """Return a direction's row: the reach, its ratio to the theory, and the limit that ends it."""
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
