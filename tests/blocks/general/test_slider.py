"""``blocks.Slider``: within its ends, moved while it runs, with its own range on the page."""

from pathlib import Path

import pytest

from aloft import LoadError, load
from aloft.blocks.general.slider import Slider
from aloft.runtime.live.tunables import Tunables
from aloft.runtime.loading import checked_text
from aloft.runtime.loading.checking.parameters import entries
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing import BlockBench

GRAPH = """
rate: 100 Hz
duration: 0.1 s
blocks:
  level: {use: blocks.Slider, with: {value: 0.1 m, lower: 0 m, upper: 0.4 m}}
  twice: {use: blocks.Gain, with: {gain: 2}, in: {u: level.y}}
"""


@pytest.mark.parametrize(("value", "shown"), [(0.5, 0.5), (7.0, 2.0), (-7.0, -1.0)])
def test_the_value_stays_within_its_ends(value: float, shown: float) -> None:
    bench = BlockBench(Slider, {"n": 2, "value": [value, 0.0], "lower": -1.0, "upper": 2.0})
    bench.step()
    assert bench.get("y").value.tolist() == [shown, 0.0]


def test_the_page_has_its_range_and_its_unit() -> None:
    graph = checked_text(GRAPH, Path("graph.yaml"))
    listed = [vars(entry) for entry in entries(BoundGraph(graph).blocks) if entry.live]
    (row,) = [row for row in Tunables(graph).rows(listed) if row["path"] == "level.value"]
    assert (row["low"], row["high"], row["value"], row["unit"]) == (0.0, 0.4, 0.1, "m")


def test_ends_that_cross_are_refused() -> None:
    with pytest.raises(LoadError, match="the lower end is above the upper one"):
        load(GRAPH.replace("lower: 0 m,", "lower: 1 m,"))
