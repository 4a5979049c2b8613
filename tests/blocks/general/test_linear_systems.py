"""``blocks.StateSpace``: exact values, exact discretisation, errors."""

import math

import numpy as np
import pytest

from aloft.blocks.general.linear_systems import (
    StateSpace,
    StateSpaceWithFeedthrough,
    TransferFunction,
)
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


PARAMS = {"a": [[0.5]], "b": [[1.0, 2.0]], "c": [[2.0]], "d": [[0.0, 10.0]]}


def test_outputs_follow_from_inputs_of_the_same_tick() -> None:
    bench = BlockBench(StateSpaceWithFeedthrough, PARAMS)
    found = []
    for u in ([1.0, 1.0], [0.0, 0.0], [0.0, 1.0]):
        bench.set("u", value=u)
        bench.step()
        found.append(bench.get("y").value.tolist())
    assert found == [[10.0], [6.0], [13.0]]


def test_d_must_fit() -> None:
    with pytest.raises(BlockError, match="d does not fit b and c"):
        BlockBench(StateSpaceWithFeedthrough, {**PARAMS, "d": [[1.0]]})


def run(inputs: np.ndarray, **params: object) -> list[float]:
    bench = BlockBench(TransferFunction, params, rate=20.0)
    found = []
    for u in inputs:
        bench.set("u", value=u)
        bench.step()
        found.append(bench.get("y").value[-1])
    return found


def test_a_continuous_one_is_scipys() -> None:
    from scipy.signal import cont2discrete, dlsim

    inputs = np.random.default_rng(2).normal(size=40)
    system = cont2discrete(([0.2, 1.0, 3.0], [2.0, 0.5, 3.0]), 0.05)
    expected = dlsim((np.ravel(system[0]), system[1], 0.05), inputs)[1][:, 0]
    found = run(inputs, n=2, numerator=[0.2, 1.0, 3.0], denominator=[2.0, 0.5, 3.0])
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_discrete_one() -> None:
    found = run(
        np.array([1.0, 0.0, 0.0]), numerator=[2.0, 0.0], denominator=[1.0, -0.5], time="discrete"
    )
    assert found == [2.0, 1.0, 0.5]


@pytest.mark.parametrize(
    ("numerator", "denominator", "message"),
    [
        ([1.0, 0.0, 0.0], [1.0, 1.0], "it is not proper"),
        ([1.0], [0.0, 1.0], "denominator's first coefficient is zero"),
    ],
)
def test_what_it_cannot_be(numerator: list[float], denominator: list[float], message: str) -> None:
    with pytest.raises(BlockError, match=message):
        BlockBench(TransferFunction, {"numerator": numerator, "denominator": denominator})
