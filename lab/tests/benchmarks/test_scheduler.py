"""The scheduler's benchmark: that it is fair and complete; how fast is for ``aloft bench``."""

import json

import numpy as np
import pytest

from aloft.lab.benchmarks.scheduler import (
    BARE,
    CHECKED,
    COUNT,
    HAND,
    PEERS,
    hand_loop,
    peer_chains,
    scheduler,
)


def test_rows_are_complete_and_no_array_is_allocated() -> None:
    rows = {row.name: row for row in scheduler(rounds=3)}
    assert {HAND, BARE, CHECKED, *PEERS, "array allocations per tick"} <= set(rows)
    assert (rows[BARE].goal, rows[CHECKED].goal) == (1.10, 1.25)
    assert rows[BARE].peer == rows[CHECKED].peer == HAND
    for name in (BARE, CHECKED):  # how large is for a benchmark to say, not for a test
        ratio = rows[name].ratio
        assert ratio is not None and ratio > 0.0
    allocations = rows["array allocations per tick"]
    assert (allocations.value, allocations.goal, allocations.met) == (0.0, 0.0, True)
    for name in PEERS:
        assert rows[name].ratio is not None or "not installed" in rows[name].note
    json.dumps([row.to_json() for row in rows.values()], allow_nan=False)


def test_the_hand_loop_is_the_reference() -> None:
    run, outputs = hand_loop()
    run(1)
    assert outputs[-1].tolist() == [0.5**COUNT] * 12


def test_a_peer_that_computes_something_else_is_no_peer(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong() -> object:
        return (lambda ticks: None), (lambda: [np.ones(12)] * COUNT)

    monkeypatch.setattr("aloft.lab.benchmarks.scheduler.PEERS", {"wrong": wrong})
    with pytest.raises(AssertionError, match="wrong: block 0 differs"):
        peer_chains([np.zeros(12)] * COUNT, 1)
