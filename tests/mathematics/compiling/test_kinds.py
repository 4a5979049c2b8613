"""What the annotations of a kernel say about its arguments."""

from __future__ import annotations

from typing import NamedTuple

from aloft.mathematics.arrays import Array1D
from aloft.mathematics.compiling.kinds import ArrayKind, RecordKind, argument_kinds


class Motion(NamedTuple):
    """A named tuple whose annotations are kept as text."""

    velocity: Array1D


def scale(motion: Motion, factor: float) -> None:
    """Has a named tuple as argument."""


def test_named_tuples_whose_annotations_are_text_are_read() -> None:
    assert argument_kinds(scale)["motion"] == RecordKind("Motion", {"velocity": ArrayKind((None,))})
