"""Load time of a large graph, and its growth with the number of blocks."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import yaml

from ...runtime.loading import checked_text
from .rows import Row

FEW, MANY = 1_000, 4_900
LOAD_GOAL, GROWTH_GOAL = 1.0, 1.3


def chain(
    count: int,
    block: str = "use: blocks.Gain, with: {gain: 1.01}",
    source: str = "use: blocks.SineWave, with: {amplitude: 1.0}",
) -> str:
    """Return a graph file of ``count`` blocks, one behind another: ``g1``, ``g2``, ...; ``g0`` is
    the source."""
    lines = ["rate: 100 Hz", "blocks:", f"  g0: {{{source}}}"]
    lines += [f"  g{k}: {{{block}, in: {{u: g{k - 1}.y}}}}" for k in range(1, count + 1)]
    return "\n".join(lines) + "\n"


def loading(rounds: int = 5) -> list[Row]:
    """Measure the processor time in which two chains load, the least of ``rounds``."""
    few, many = chain(FEW), chain(MANY)
    checked_text(chain(1), "chain.yaml")  # imports the blocks
    times: dict[str, list[float]] = {"few": [], "many": [], "yaml": []}
    for _ in range(rounds):
        times["few"].append(_time_to_load(few))
        times["many"].append(_time_to_load(many))
        start = time.process_time()
        yaml.load(many, getattr(yaml, "CSafeLoader", yaml.SafeLoader))
        times["yaml"].append(time.process_time() - start)
    least = {name: float(np.min(values)) for name, values in times.items()}
    per_block = least["many"] / MANY / (least["few"] / FEW)
    return [
        Row(f"a chain of {FEW:,} blocks loads, processor time", least["few"], "s"),
        Row(f"a chain of {MANY:,} blocks loads, processor time", least["many"], "s", goal=LOAD_GOAL),
        Row(
            f"a block of {MANY:,}", least["many"] / MANY * 1e6, "us", f"a block of {FEW:,}",
            per_block, GROWTH_GOAL,
        ),
        Row(
            f"the file of {MANY:,} blocks into a checked graph", least["many"], "s",
            "PyYAML with libyaml into plain data", least["many"] / least["yaml"],
        ),
    ]  # fmt: skip


def _time_to_load(text: str) -> float:
    start = time.process_time()
    checked_text(text, Path("chain.yaml"))
    return time.process_time() - start
