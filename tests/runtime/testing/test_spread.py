"""The helper that runs all parts of a graph in threads."""

import pytest

from aloft.runtime.language.errors import AloftError
from aloft.runtime.testing.spread import run_spread

from ..links.example_graphs import ring


def test_rows_of_parts_that_ended_apart_are_refused() -> None:
    spread_out = run_spread(ring(ticks=10))
    assert spread_out.ticks == 10 and len(spread_out.rows) == 10
    log = spread_out.results["near"].log
    assert log is not None
    log.ticks.append(10)
    with pytest.raises(AloftError, match=r"recorded different numbers of ticks: .*'near': 11"):
        _ = spread_out.rows


def test_parts_that_do_not_end_are_an_error() -> None:
    with pytest.raises(AloftError, match=r"not all parts ended within 0.3 s"):
        # The factor keeps the ring's numbers small: they must not end the run by an overflow.
        run_spread(ring({"factor": 0.5}, ticks=10**7), wall_time=0.3)
