"""The scheduler's benchmark: that it is fair and complete; how fast is for ``aloft bench``."""

import json

import numpy as np
import pytest

from aloft.benchmarks import BENCHMARKS, run_benchmarks
from aloft.benchmarks.filter_chain import COUNT, hand_loop
from aloft.benchmarks.peers import PEERS, peer_chains
from aloft.benchmarks.rows import Row, compare, take_turns
from aloft.benchmarks.scheduler import BARE, CHECKED, HAND, scheduler


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

    monkeypatch.setattr("aloft.benchmarks.peers.PEERS", {"wrong": wrong})
    with pytest.raises(AssertionError, match="wrong: block 0 differs"):
        peer_chains([np.zeros(12)] * COUNT, 1)


def test_ratios_are_of_the_same_round() -> None:
    times = {"a": np.array([1.0, 10.0, 2.0]), "b": np.array([2.0, 20.0, 5.0])}
    row = compare("b", times, "a", goal=2.0)
    assert (row.value, row.ratio, row.met) == (5.0, 2.0, True)
    assert compare("b", times, "a", goal=1.9).met is False


def test_goals() -> None:
    assert Row("x", 0.0, "1/tick", goal=0.0).met is True
    assert Row("x", 0.5, "1/tick", goal=0.0).met is False
    assert Row("x", 0.5, "s").met is None
    assert Row("x", None, "s", peer="y", goal=1.0).met is None


def test_cases_take_turns_in_shifting_order() -> None:
    calls: list[str] = []
    cases = {name: (lambda n, name=name: calls.append(f"{name}{n}")) for name in "ab"}
    times = take_turns(cases, rounds=3, repetitions=7)
    assert calls == ["a7", "b7", "a7", "b7", "b7", "a7", "a7", "b7"]
    assert all(values.shape == (3,) and (values >= 0).all() for values in times.values())


def test_the_report(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aloft.benchmarks.BENCHMARKS", {"one": lambda: [Row("x", 1.0, "s")]})
    report = run_benchmarks()
    assert set(report) == {"machine", "load", "rows"}
    assert report["rows"][0]["name"] == "x" and report["rows"][0]["met"] is None
    assert report["machine"]["cores"] >= 1
    with pytest.raises(KeyError, match="no benchmark 'two'; there is one"):
        run_benchmarks(["two"])
    assert "scheduler" in BENCHMARKS
