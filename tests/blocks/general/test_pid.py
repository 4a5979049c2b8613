"""``blocks.PID``: every part by itself, and that it does not wind up."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.blocks.general.pid import PID
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


def run(pairs: list[tuple[float, float]], **params: object) -> list[float]:
    bench = BlockBench(PID, params, rate=10.0)
    found = []
    for r, y in pairs:
        bench.set("setpoint", value=r)
        bench.set("measured", value=y)
        bench.step()
        found.append(float(bench.get("u").value[0]))
    return found


def test_proportional_part_with_its_weight() -> None:
    assert run([(4.0, 1.0)], kp=2.0, b=0.5) == [2.0]


def test_integral_part() -> None:
    assert run([(3.0, 1.0)] * 3, kp=0.0, ki=5.0) == pytest.approx([0.0, 1.0, 2.0])


def test_derivative_part_is_of_the_measurement() -> None:
    found = run([(0, 0), (9, 0.1), (0, 0.2)], kp=0.0, kd=1.0, derivative_time_constant=0.0)
    assert found == pytest.approx([0.0, -1.0, -1.0])


def test_derivative_part_is_filtered() -> None:
    found = run([(0, 0), (0, 0.2), (0, 0.2)], kp=0.0, kd=1.0, derivative_time_constant=0.1)
    assert found == pytest.approx([0.0, -1.0, -0.5])


def test_feedforward_and_reset() -> None:
    bench = BlockBench(PID, {"kp": 0.0, "ki": 10.0}, rate=10.0)
    bench.set("feedforward", value=0.5)
    bench.set("setpoint", value=1.0)
    bench.step(4)
    assert bench.get("u").value[0] == pytest.approx(3.5)
    bench.set("reset", value=True)
    bench.step()
    assert bench.get("u").value[0] == 0.5


@settings(max_examples=15, deadline=None)
@given(st.floats(0.5, 20.0), st.floats(0.1, 5.0))
def test_it_leaves_its_bound_soon_after_the_error_turns(ki: float, error: float) -> None:
    pairs = [(error, 0.0)] * 200 + [(-error, 0.0)] * 30
    found = run(pairs, kp=1.0, ki=ki, lower=-1.0, upper=1.0, tracking_time=0.1)
    assert all(-1.0 <= u <= 1.0 for u in found)
    without = run(pairs, kp=1.0, ki=ki, lower=-1.0, upper=1.0, tracking_time=1e9)
    assert sum(found[200:]) <= sum(without[200:])
    if ki * error >= 1.0:
        assert found[-1] < 0.0 < without[-1]


def test_bounds_must_not_cross() -> None:
    with pytest.raises(BlockError, match="lower bound of element 0 is above the upper one"):
        BlockBench(PID, {"lower": 1.0, "upper": 0.0})


def test_a_bound_leaves_nothing_behind_where_there_is_no_integral() -> None:
    found = run([(3.0, 0.0)] * 5 + [(3.0, 2.5)], kp=2.0, upper=1.5)
    assert found == pytest.approx([1.5] * 5 + [1.0])
