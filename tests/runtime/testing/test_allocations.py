"""The counter sees every array, also one that lives for one expression, and nothing else."""

from collections.abc import Callable

import numpy as np
import pytest

from aloft.runtime.testing import allocations
from aloft.runtime.testing.allocations import count_array_allocations

VECTOR = np.ones(12)
MATRIX = np.eye(12)
OUT = np.zeros(12)
SCALAR = np.zeros(())
FACTOR = np.array(0.5)


@pytest.mark.parametrize(
    ("call", "arrays", "boxed"),
    [
        (lambda: np.zeros(3), 1, 0),
        (lambda: np.empty(100_000), 1, 0),
        (lambda: (VECTOR + VECTOR) * VECTOR, 2, 0),
        (lambda: VECTOR.copy(), 1, 0),
        (lambda: MATRIX @ VECTOR, 1, 0),
        (lambda: np.array([1.0, 2.0]), 1, 0),
        (lambda: np.dot(VECTOR, VECTOR), 0, 1),
        (lambda: np.multiply(VECTOR, 0.5, out=OUT), 0, 1),
        (lambda: np.multiply(VECTOR, FACTOR, out=OUT), 0, 0),
        (lambda: np.dot(VECTOR, VECTOR, SCALAR), 0, 0),
        (lambda: np.matmul(MATRIX, VECTOR, out=OUT), 0, 0),
        (lambda: VECTOR[2:5].reshape(3, 1), 0, 0),
        (lambda: OUT.fill(2.0), 0, 0),
        (lambda: np.copyto(OUT, VECTOR), 0, 0),
        (lambda: VECTOR[3] + 1.0, 0, 0),
    ],
)
def test_what_is_counted(call: Callable[[], object], arrays: int, boxed: int) -> None:
    call()
    with count_array_allocations() as counted:
        call()
    assert (counted.count, counted.boxed) == (arrays, boxed)


def test_places_and_bytes() -> None:
    with count_array_allocations() as counted:
        for _ in range(9):
            np.zeros(4)
    assert counted.count == 9
    assert counted.total_bytes == 9 * 32
    assert len(counted.places) == 5
    assert counted.places[0].rpartition(":")[0] == __file__


def test_it_ends_with_the_block_also_after_an_error() -> None:
    with pytest.raises(ValueError, match="inside"), count_array_allocations() as counted:
        np.zeros(3)
        raise ValueError("inside")
    np.zeros(3)
    assert counted.count == 1


def test_inner_counts_are_apart() -> None:
    with count_array_allocations() as outer:
        np.zeros(3)
        with count_array_allocations() as inner:
            np.zeros(3)
        np.zeros(3)
    assert (outer.count, inner.count) == (2, 1)


def test_arrays_made_inside_live_on() -> None:
    with count_array_allocations():
        arrays = [np.full(1000, i) for i in range(100)]
        arrays[0].resize(5000, refcheck=False)
    assert [int(array[-1]) for array in arrays[1:]] == list(range(1, 100))
    del arrays


def test_another_interface_of_numpy_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A counter that does not count must not let every test of it pass."""
    monkeypatch.setattr(allocations, "_counters", [])
    monkeypatch.setattr(allocations._Counter, "_note", lambda self, size, frame: None)
    wrong = pytest.raises(RuntimeError, match="the counter of arrays does not work with NumPy")
    with wrong, count_array_allocations():
        pass


def test_zeros_are_counted_with_the_bytes_of_all_elements() -> None:
    with count_array_allocations() as counted:
        assert allocations._counters[0]._count_calloc(None, 5, 40)
    assert (counted.count, counted.total_bytes) == (1, 200)
