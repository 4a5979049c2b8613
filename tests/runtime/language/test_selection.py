"""Selections: their text, and the elements they take, compared with NumPy's own."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.runtime.language.selection import WHOLE, Selection, read_selection, runs, select

NAMES = ("left_hip", "left_knee", "right_hip", "right_knee")


@pytest.mark.parametrize(
    ("text", "source", "selection"),
    [
        ("a.y", "a.y", WHOLE),
        ("leg/a.y.value", "leg/a.y", Selection("value")),
        ("a.y.value[2]", "a.y", Selection("value", ("2",))),
        ("a.y[0:2][1]", "a.y", Selection("", ("0:2", "1"))),
        ("inputs.joints.position[*_knee]", "inputs.joints", Selection("position", ("*_knee",))),
    ],
)
def test_texts(text: str, source: str, selection: Selection) -> None:
    assert read_selection(text) == (source, selection)
    assert f"{source}{selection}" == text


@pytest.mark.parametrize("text", ["a", "a.b.c.d", "a.y[", "a.y]", "3", "a.y[1]x", ""])
def test_what_is_no_source(text: str) -> None:
    assert read_selection(text) is None


@given(st.integers(1, 9), st.data())
def test_slices_are_those_of_numpy(size: int, data: st.DataObject) -> None:
    ends = st.none() | st.integers(-size, size)
    start, stop = data.draw(ends), data.draw(ends)
    step = data.draw(st.none() | st.integers(-3, 3).filter(bool))
    text = ":".join("" if end is None else str(end) for end in (start, stop, step))
    expected = np.arange(size)[slice(start, stop, step)]
    if not expected.size:
        with pytest.raises(ValueError, match="selects nothing"):
            select(Selection("", (text,)), (size,))
    else:
        assert np.array_equal(select(Selection("", (text,)), (size,)), expected)


@given(st.lists(st.integers(0, 30), min_size=1, max_size=20))
def test_runs_cover_every_place_in_order(places: list[int]) -> None:
    found = [a + k for a, _, length in runs(np.array(places)) for k in range(length)]
    starts = [b for _, b, _ in runs(np.array(places))]
    assert found == places
    assert starts == sorted(starts)


@pytest.mark.parametrize(
    ("index", "expected"),
    [
        ("left_knee", 1),
        ("*_knee", [1, 3]),
        ("left_knee:right_hip", [1, 2]),
        ("left_knee:", [1, 2, 3]),
        (":left_knee", [0, 1]),
        ("-1", 3),
        ("1:3", [1, 2]),
    ],
)
def test_names(index: str, expected: object) -> None:
    assert select(Selection("", (index,)), (4,), NAMES).tolist() == expected


def test_rows_and_elements_of_matrices() -> None:
    assert select(Selection("", ("1",)), (2, 3)).tolist() == [3, 4, 5]
    assert select(Selection("", ("1, 2",)), (2, 3)).tolist() == 5
    assert select(Selection("", (":, 0",)), (2, 3)).tolist() == [0, 3]
    assert select(Selection("", ("0:2", "1", "2")), (2, 3)).tolist() == 5


@pytest.mark.parametrize(
    ("index", "message"),
    [
        ("4", r"\[4\] is outside of 4 elements, which count from 0"),
        ("left_kne", r"\[left_kne\] is none of left_hip, .*; did you mean left_knee\?"),
        ("x_*", r"\[x_\*\] matches none of left_hip"),
        ("0, 0", r"\[0, 0\] has 2 indices for an array of shape \[4\]"),
        ("2:2", r"\[2:2\] selects nothing of 4 elements"),
        ("::0", r"\[::0\] has a step of zero"),
        ("1:2:3:4", r"\[1:2:3:4\] is not a slice"),
    ],
)
def test_mistakes(index: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        select(Selection("", (index,)), (4,), NAMES)


def test_elements_without_names() -> None:
    with pytest.raises(
        ValueError, match=r"\[knee\] is not a whole number, and these elements have"
    ):
        select(Selection("", ("knee",)), (4,))
    with pytest.raises(ValueError, match=r"\[\*_knee\] is a pattern of names, and these"):
        select(Selection("", ("*_knee",)), (4,))
    with pytest.raises(ValueError, match="has 1 indices for one number"):
        select(Selection("", ("0",)), ())
