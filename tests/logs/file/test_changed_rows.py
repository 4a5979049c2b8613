"""What is left out of a signal comes back bit for bit, and the line drawn through it is the same."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.logs.file.changed_rows import ChangedRows
from aloft.logs.file.format import spans


def filled(ticks: np.ndarray, written: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The value at each of ``ticks``: the last that was written at or before it."""
    return values[np.searchsorted(written, ticks, side="right") - 1]


ODD = np.array([0.0, -0.0, np.nan, -np.nan, 1.0, np.nextafter(1.0, 2.0)])


@settings(max_examples=200, deadline=None)
@given(
    batches=st.lists(
        st.lists(st.tuples(st.integers(1, 3), st.integers(0, 5), st.integers(0, 1)), min_size=1),
        min_size=1,
        max_size=4,
    )
)
def test_everything_comes_back(batches: list[list[tuple[int, int, int]]]) -> None:
    picker = ChangedRows()
    all_ticks, all_values, written, kept = [], [], [], []
    tick = 0
    for batch in batches:
        ticks = tick + np.cumsum([step for step, *_ in batch])
        tick = int(ticks[-1])
        values = ODD[[[first, second] for _, first, second in batch]]
        some_ticks, some = picker.pick(ticks, values)
        all_ticks.append(ticks), all_values.append(values)
        written.append(some_ticks), kept.append(some)
    whole = np.concatenate(all_values)
    ticks = np.concatenate(all_ticks)
    found = filled(ticks, np.concatenate(written), np.concatenate(kept))
    assert found.tobytes() == whole.tobytes()  # before the rest: as after a kill
    if (rest := picker.rest()) is not None:
        written.append(rest[0]), kept.append(rest[1])
    assert picker.rest() is None
    at = np.concatenate(written)
    assert (np.diff(at) > 0).all() and set(at) <= set(ticks)
    assert at[0] == ticks[0] and at[-1] == ticks[-1]
    for first, last in pairwise(at):  # between two that are there, nothing moves
        between = whole[(ticks >= first) & (ticks <= last)]
        assert len(between) == 2 or len({row.tobytes() for row in between}) == 1


def test_a_constant_is_two_values_and_a_step_four() -> None:
    picker = ChangedRows()
    values = np.zeros((10, 1))
    values[5:] = 1.0
    ticks, kept = picker.pick(np.arange(10), values)
    assert ticks.tolist() == [0, 4, 5] and kept[:, 0].tolist() == [0.0, 0.0, 1.0]
    ticks, _ = picker.pick(np.arange(10, 20), np.ones((10, 1)))
    assert len(ticks) == 0
    ticks, kept = picker.pick(np.arange(20, 21), np.zeros((1, 1)))
    assert ticks.tolist() == [19, 20] and kept[:, 0].tolist() == [1.0, 0.0]


def test_spans_are_the_stretches_without_a_gap() -> None:
    assert spans(np.array([3])).tolist() == [[3, 3]]
    assert spans(np.array([0, 1, 2, 5, 6, 9])).tolist() == [[0, 2], [5, 6], [9, 9]]
