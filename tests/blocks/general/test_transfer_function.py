"""``blocks.TransferFunction``: responses that are known, and its errors."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from aloft.blocks.general.transfer_function import TransferFunction
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench


def run(inputs: np.ndarray, **params: object) -> list[float]:
    bench = BlockBench(TransferFunction, params, rate=20.0)
    found = []
    for u in inputs:
        bench.set("u", value=u)
        bench.step()
        found.append(bench.get("y").value[-1])
    return found


def test_a_continuous_one_is_scipys() -> None:
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
