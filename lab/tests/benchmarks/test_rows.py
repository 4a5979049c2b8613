"""The rows of benchmarks, and cases that take turns."""

import os
import time

import numpy as np
import pytest

from aloft.lab.benchmarks.rows import Row, compare, other_process, take_turns


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


ECHO = """
import json, os, sys
for line in sys.stdin:
    print(json.dumps([os.getpid(), line.strip()]), flush=True)
"""


def gone(pid: int) -> bool:
    """Whether there is no such process, soon."""
    for _ in range(500):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.01)
    return False


def test_it_answers_and_ends() -> None:
    with other_process(ECHO) as other:
        pid, said = other.ask("one")
        assert said == "one" and other.ask("two") == [pid, "two"]
    assert gone(pid)


def test_it_ends_when_the_measurement_fails_and_when_it_is_frozen() -> None:
    with pytest.raises(ZeroDivisionError), other_process(ECHO) as other:
        pid, _ = other.ask("one")
        other.freeze()
        _ = 1 / 0
    assert gone(pid)
