"""``blocks.Gain``: exact values."""

import pytest
from pydantic import ValidationError

from aloft.blocks.general.arithmetic import Gain, MatrixGain, Product, Sum
from aloft.runtime.testing import BlockBench


def test_gain_multiplies() -> None:
    bench = BlockBench(Gain, {"n": 2, "gain": -3.0})
    bench.set("u", value=[1.0, 0.5])
    bench.step()
    assert bench.get("y").value.tolist() == [-3.0, -1.5]


def test_gain_multiplies_each_element_by_its_own() -> None:
    bench = BlockBench(Gain, {"n": 2, "gain": [2.0, 4.0]})
    bench.set("u", value=[1.0, 0.5])
    bench.step()
    assert bench.get("y").value.tolist() == [2.0, 2.0]


def test_a_list_must_have_n_gains() -> None:
    with pytest.raises(ValidationError, match="gain has 2 elements, expected n = 3"):
        BlockBench(Gain, {"n": 3, "gain": [2.0, 4.0]})


def test_sum_subtracts_with_a_negative_weight() -> None:
    bench = BlockBench(Sum, {"n": 2, "weights": [2.0, -1.0]})
    bench.set("a", value=[1.0, 2.0])
    bench.set("b", value=[0.5, 5.0])
    bench.step()
    assert bench.get("y").value.tolist() == [1.5, -1.0]


@pytest.mark.parametrize(
    ("operation", "expected"), [("multiply", [6.0, -2.0]), ("divide", [1.5, -0.5])]
)
def test_product(operation: str, expected: list[float]) -> None:
    bench = BlockBench(Product, {"n": 2, "operation": operation})
    bench.set("a", value=[3.0, 1.0])
    bench.set("b", value=[2.0, -2.0])
    bench.step()
    assert bench.get("y").value.tolist() == expected


def test_matrix_gain_multiplies() -> None:
    bench = BlockBench(MatrixGain, {"matrix": [[1.0, 2.0, 0.0], [0.0, -1.0, 4.0]]})
    bench.set("u", value=[1.0, 2.0, 3.0])
    bench.step()
    assert bench.get("y").value.tolist() == [5.0, 10.0]


def test_rows_must_be_equally_long() -> None:
    with pytest.raises(ValidationError, match=r"rows of one length, found lengths \[2, 1\]"):
        BlockBench(MatrixGain, {"matrix": [[1.0, 2.0], [3.0]]})
