"""The rows of benchmarks, and cases that take turns."""

import numpy as np

from aloft.benchmarks.rows import Row, compare, take_turns


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


def test_ratios_are_of_the_same_round() -> None:
    times = {"a": np.array([1.0, 10.0, 2.0]), "b": np.array([2.0, 20.0, 5.0])}
    row = compare("b", times, "a", goal=2.0)
    assert (row.value, row.ratio, row.met) == (5.0, 2.0, True)
    assert compare("b", times, "a", goal=1.9).met is False
