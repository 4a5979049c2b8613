"""``blocks.Logic``: the truth tables."""

import pytest

from aloft.blocks.general.logic import Compare, Counter, EdgeDetector, Logic, Not, Switch, Timer
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize(
    ("operation", "expected"),
    [("and", "0001"), ("or", "0111"), ("xor", "0110"), ("nand", "1110"), ("nor", "1000")],
)
def test_logic(operation: str, expected: str) -> None:
    bench = BlockBench(Logic, {"n": 4, "operation": operation})
    bench.set("a", value=[False, False, True, True])
    bench.set("b", value=[False, True, False, True])
    bench.step()
    assert bench.get("y").value.tolist() == [digit == "1" for digit in expected]


@pytest.mark.parametrize(
    ("operation", "expected"),
    [("<", "100"), ("<=", "110"), ("==", "010"), ("!=", "101"), (">=", "011"), (">", "001")],
)
def test_compare(operation: str, expected: str) -> None:
    bench = BlockBench(Compare, {"n": 3, "operation": operation})
    bench.set("a", value=[1.0, 2.0, 3.0])
    bench.set("b", value=2.0)
    bench.step()
    assert bench.get("y").value.tolist() == [digit == "1" for digit in expected]


def test_not() -> None:
    bench = BlockBench(Not, {"n": 2})
    bench.set("u", value=[True, False])
    bench.step()
    assert bench.get("y").value.tolist() == [False, True]


@pytest.mark.parametrize(
    ("edge", "expected"), [("rising", "00100"), ("falling", "01001"), ("either", "01101")]
)
def test_edges(edge: str, expected: str) -> None:
    bench = BlockBench(EdgeDetector, {"edge": edge})
    found = ""
    for u in (True, False, True, True, False):
        bench.set("u", value=u)
        bench.step()
        found += str(int(bench.get("y").value[0]))
    assert found == expected


def test_counter_counts_wraps_and_starts_anew() -> None:
    bench = BlockBench(Counter, {"last": 2})
    found = []
    for u, reset in ((0, 0), (1, 0), (1, 0), (0, 0), (1, 0), (1, 0), (1, 1)):
        bench.set("u", value=bool(u))
        bench.set("reset", value=bool(reset))
        bench.step()
        found.append(bench.get("y").value[0])
    assert found == [0, 1, 2, 2, 0, 1, 0]


def test_timer_begins_again_after_a_break() -> None:
    bench = BlockBench(Timer, {"duration": "200 ms"}, rate=10.0)
    elapsed, done = [], ""
    for u in (False, True, True, True, True, False, True):
        bench.set("u", value=u)
        bench.step()
        elapsed.append(bench.get("elapsed").value[0])
        done += str(int(bench.get("done").value))
    assert elapsed == pytest.approx([0.0, 0.0, 0.1, 0.2, 0.3, 0.0, 0.0])
    assert done == "0001100"


def test_switch() -> None:
    bench = BlockBench(Switch, {"n": 2})
    bench.set("a", value=[1.0, 2.0])
    bench.set("b", value=[3.0, 4.0])
    for condition, expected in ((True, [1.0, 2.0]), (False, [3.0, 4.0])):
        bench.set("condition", value=condition)
        bench.step()
        assert bench.get("y").value.tolist() == expected
