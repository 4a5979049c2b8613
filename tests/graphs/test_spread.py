"""Every kind of shipped graph, spread over three machines at random, gives the bytes of one process."""

from pathlib import Path

import numpy as np
import pytest

from aloft.runtime.loading import checked_file
from aloft.runtime.placement.placed import spread
from aloft.runtime.running.executor import run
from aloft.runtime.testing.spread import run_spread

from ..shipped import kinds

MACHINES = {name: f"tcp/127.0.0.1:{7450 + k}" for k, name in enumerate("abc")}
TICKS = 25
GRAPHS = kinds()


@pytest.mark.long
@pytest.mark.parametrize("address", GRAPHS)
def test_bytes_do_not_depend_on_the_split(address: str) -> None:
    graph = checked_file(GRAPHS[address])
    rng = np.random.default_rng(len(address))
    places = {spec.path: str(rng.choice(list(MACHINES))) for spec in graph.blocks}
    alone = run(graph, TICKS)
    spread_out = run_spread(spread(graph, MACHINES, places), TICKS, timeout=60.0, wall_time=200.0)
    assert spread_out.ticks == alone.ticks
    assert spread_out.run_hash == alone.run_hash


@pytest.mark.long
@pytest.mark.parametrize("path", sorted((Path(__file__).parents[2] / "graphs/machines").glob("*")))
def test_shipped_placements(path: Path) -> None:
    graph = checked_file(path)
    assert run_spread(graph, TICKS, timeout=60.0).run_hash == run(graph, TICKS).run_hash
