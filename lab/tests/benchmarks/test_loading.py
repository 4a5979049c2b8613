"""The chain that is loaded has as many blocks as it says, and loading it is measured."""

from __future__ import annotations

import pytest

from aloft.lab.benchmarks.loading import chain, loading
from aloft.runtime.loading import checked_text


def test_the_chain_has_its_source_and_as_many_gains() -> None:
    graph = checked_text(chain(3), "chain.yaml")
    assert graph.order == ("g0", "g1", "g2", "g3")


@pytest.mark.long
def test_the_rows_are_complete() -> None:
    rows = loading(rounds=1)
    assert [row.goal for row in rows] == [None, 1.0, 1.3, None]
    assert all(row.value is not None and row.value > 0.0 for row in rows)
