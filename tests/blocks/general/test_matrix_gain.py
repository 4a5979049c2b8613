"""``blocks.MatrixGain``: exact values and its errors."""

import pytest
from pydantic import ValidationError

from aloft.blocks.general.matrix_gain import MatrixGain
from aloft.runtime.testing import BlockBench


def test_matrix_gain_multiplies() -> None:
    bench = BlockBench(MatrixGain, {"matrix": [[1.0, 2.0, 0.0], [0.0, -1.0, 4.0]]})
    bench.set("u", value=[1.0, 2.0, 3.0])
    bench.step()
    assert bench.get("y").value.tolist() == [5.0, 10.0]


def test_rows_must_be_equally_long() -> None:
    with pytest.raises(ValidationError, match=r"rows of one length, found lengths \[2, 1\]"):
        BlockBench(MatrixGain, {"matrix": [[1.0, 2.0], [3.0]]})
