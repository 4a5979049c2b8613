"""Checks of the points of tables that blocks share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

from ...runtime.language.block import Misfit


def unsorted_points(name: str, points: Sequence[float]) -> Iterable[Misfit]:
    """A misfit where points do not rise from each to the next."""
    for one, two in pairwise(points):
        if two <= one:
            yield Misfit(
                f"{name} does not rise",
                parameter=name.partition("[")[0],
                expected=f"more than {one:g} behind {one:g}",
                found=f"{two:g}",
            )
            return
