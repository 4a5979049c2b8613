"""Layout: three packed sections, 64-byte aligned, floats first."""

import numpy as np
import pytest

from aloft.runtime.language.errors import DeclarationError
from aloft.runtime.language.layout import Layout, PortLayout
from aloft.runtime.language.signals import Field, Signal


class Reading(Signal):
    matrix = Field(("n", 2), text="numbers")
    count = Field(dtype="int64", text="a count")
    flags = Field("n", dtype="bool", text="flags")
    value = Field(text="a number")


def two_ports() -> Layout:
    return Layout.of([PortLayout("a.y", Reading, {"n": 3}), PortLayout("b.y", Reading, {"n": 1})])


def test_sections_are_packed_in_order_and_aligned() -> None:
    layout = two_ports()
    assert layout.lengths == {"float64": 10, "int64": 2, "bool": 4}
    assert layout.offsets == {"float64": 0, "int64": 128, "bool": 192}
    assert layout.size == 256
    starts = {name: slot.start for name, slot in layout.slots.items()}
    assert starts == {
        "a.y.matrix": 0, "a.y.count": 0, "a.y.flags": 0, "a.y.value": 6,
        "b.y.matrix": 7, "b.y.count": 1, "b.y.flags": 3, "b.y.value": 9,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("index", "name"),
    [(0, "a.y.matrix[0, 0]"), (5, "a.y.matrix[2, 1]"), (6, "a.y.value"), (8, "b.y.matrix[0, 1]")],
)
def test_an_element_is_located_by_name(index: int, name: str) -> None:
    assert two_ports().locate("float64", index) == name


def test_an_index_outside_is_an_error() -> None:
    with pytest.raises(IndexError, match="section float64 has 10 elements, not 10"):
        two_ports().locate("float64", 10)


def test_views_of_one_and_of_many_buffers() -> None:
    layout = two_ports()
    rows = np.zeros((4, layout.size), np.uint8)
    for i, row in enumerate(rows):
        layout.view(row, "b.y.count")[...] = i
        layout.view(row, "a.y.matrix")[1, 0] = 0.5 * i
    assert layout.view(rows, "b.y.count").tolist() == [0, 1, 2, 3]
    assert layout.view(rows, "a.y.matrix").shape == (4, 3, 2)
    assert layout.view(rows, "a.y.matrix")[:, 1, 0].tolist() == [0.0, 0.5, 1.0, 1.5]


def test_a_dimension_without_a_size_is_an_error() -> None:
    with pytest.raises(DeclarationError) as caught:
        Layout.of([PortLayout("a.y", Reading, {"m": 2, "k": 1})])
    assert str(caught.value) == (
        "a.y.matrix (float64[n, 2]): dimension 'n' has no size; known are k, m. Give it under "
        "'dimensions', through a robot, or as an integer parameter of the block"
    )


def test_nothing_to_lay_out() -> None:
    assert Layout.of([]).size == 0
