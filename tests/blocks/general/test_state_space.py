"""``blocks.StateSpace``: exact values, exact discretisation, errors."""

import math

import pytest

from aloft.blocks.general.state_space import StateSpace
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


def test_a_discrete_system() -> None:
    params = {"a": [[0.5, 1.0], [0.0, 1.0]], "b": [[0.0], [2.0]], "c": [[1.0, 0.0], [0.0, 3.0]]}
    bench = BlockBench(StateSpace, {**params, "initial": [4.0, 0.0]})
    found = []
    for u in (1.0, 0.0, 0.0):
        bench.set("u", value=u)
        bench.step()
        found.append(bench.get("y").value.tolist())
    assert found == [[4.0, 0.0], [2.0, 6.0], [3.0, 6.0]]


def test_a_continuous_system_is_discretised_exactly() -> None:
    params = {"a": [[-2.0]], "b": [[2.0]], "c": [[1.0]], "time": "continuous"}
    bench = BlockBench(StateSpace, params, rate=10.0)
    bench.set("u", value=1.0)
    for k in range(20):
        bench.step()
        assert bench.get("y").value[0] == pytest.approx(1.0 - math.exp(-2.0 * k / 10.0), abs=1e-14)


def test_matrices_must_fit() -> None:
    params = {"a": [[1.0, 0.0]], "b": [[1.0], [1.0]], "c": [[1.0]], "initial": [0.0, 0.0]}
    with pytest.raises(BlockError, match=r"a has 2 columns, .* order 1; b has 2 rows, .* initial"):
        BlockBench(StateSpace, params)
