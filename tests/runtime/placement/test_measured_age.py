"""Ages on paths as a run has measured them, also through messages between clocks that differ."""

from pathlib import Path

import numpy as np
import pytest

from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.loading import checked_text
from aloft.runtime.placement.age import LinkTimes, Timeline, measured_ages, worst_age

PATH = Path("graph.yaml")
MS = 1_000_000
SENSOR = "  sensor: {use: blocks.Constant, with: {value: [1.0]}}\n"


def graph(blocks: str, head: str = "rate: 100 Hz\n") -> CheckedGraph:
    return checked_text(f"{head}blocks:\n{SENSOR}{blocks}", PATH)


def even(n: int, period: int = 10 * MS, start: int = 5000 * MS) -> list[int]:
    return [start + k * period for k in range(n)]


CHAINS = [
    "  b: {use: blocks.Gain, in: {u: sensor.y}}\n",
    "  a: {use: blocks.UnitDelay, in: {u: sensor.y}}\n  b: {use: blocks.Gain, in: {u: a.y}}\n",
    "  b: {use: blocks.Gain, in: {u: {from: sensor.y, delay: 3}}}\n",
    "  a: {use: blocks.Gain, in: {u: sensor.y}, rate: 25 Hz}\n  b: {use: blocks.Gain, in: {u: a.y}}\n",
    "  b: {use: blocks.Gain, in: {u: sensor.y}, rate: 25 Hz, offset: 3}\n",
    "  b: {use: blocks.UnitDelay, in: {u: sensor.y}}\n",
]


@pytest.mark.parametrize("chain", CHAINS)
def test_where_ticks_are_even_the_longest_is_what_is_computed_before(chain: str) -> None:
    checked = graph(chain)
    ages = measured_ages(checked, {"": Timeline(range(60), even(60))}, "sensor.y", "b.u")
    expected = worst_age(checked, "sensor.y", "b.u")
    assert expected is not None and ages.max() == pytest.approx(expected)
    assert len(ages) >= 10


def test_a_tick_that_is_late_lengthens_the_ages_over_it() -> None:
    began = np.array(even(20))
    began[10:] += 7 * MS
    ages = measured_ages(
        graph(CHAINS[1]), {"": Timeline(range(20), began.tolist())}, "sensor.y", "b.u"
    )
    np.testing.assert_allclose(sorted(ages * 1e3)[-3:], [20.0, 27.0, 27.0])


HEAD = """rate: 100 Hz
clock: {kind: paced}
machines: {near: tcp/127.0.0.1:7450, far: tcp/127.0.0.1:7451}
links: {mode: free, max_age: 100 ms}
"""
ROUND = (
    "  away: {use: blocks.Gain, in: {u: sensor.y}, on: far}\n"
    "  back: {use: blocks.Gain, in: {u: away.y}}\n"
)


def spread_lines(shift: int) -> dict[str, Timeline]:
    """A message takes 1 ms there and 2 ms back; blocks run 0.5 ms after their tick began; the far
    clock is ahead by ``shift``, and far ticks begin 4 ms after the near ones."""
    n = 30
    near, far = even(n), [t + 4 * MS for t in even(n)]
    half = MS // 2
    # far reads in tick k what near sent in tick k, 0.5 ms after its beginning
    there = LinkTimes(
        tick=list(range(n)),
        sent=[t + half for t in near],
        read=[t + half + shift for t in far],
        age=[4 * MS] * n,
    )
    # near reads in tick k what far sent in tick k - 1
    back = LinkTimes(
        tick=[-1, *range(n - 1)],
        sent=[0, *(t + half + shift for t in far[:-1])],
        read=[t + half for t in near],
        age=[0, *[6 * MS] * (n - 1)],
    )
    return {
        "near": Timeline(range(n), near, {"away": back}),
        "far": Timeline(range(n), [t + shift for t in far], {"sensor": there}),
    }


@pytest.mark.parametrize("shift", [0, 3_600_000 * MS, -77 * MS])
def test_through_two_machines_and_back(shift: int) -> None:
    ages = measured_ages(graph(ROUND, HEAD), spread_lines(shift), "sensor.y", "back.u")
    # sampled in near's tick k - 1, used in tick k until tick k + 1
    assert len(ages) == 28
    np.testing.assert_allclose(ages, 0.02, atol=1e-9)


def test_recordings_that_do_not_belong_together_give_no_ages() -> None:
    lines = spread_lines(0)
    lines["far"] = Timeline([k + 500 for k in range(30)], lines["far"].began, lines["far"].links)
    assert len(measured_ages(graph(ROUND, HEAD), lines, "sensor.y", "back.u")) == 0
