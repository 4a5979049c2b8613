"""Signals of the blocks that join and split vectors."""

from __future__ import annotations

from collections.abc import Mapping

from ...robots.description import RobotDescription
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal


class First(Signal):
    """A vector of ``n_a`` numbers."""

    value = Field("n_a", carried=True, text="the first elements")


class Second(Signal):
    """A vector of ``n_b`` numbers."""

    value = Field("n_b", carried=True, text="the elements behind them")


class Joined(Signal):
    """A vector of ``n_a + n_b`` numbers."""

    value = Field("n", carried=True, text="first those of a, then those of b")


class PairSizes(Parameters):
    """The sizes of two vectors that make one."""

    n_a: int = parameter(1, ge=1, text="elements of a")
    n_b: int = parameter(1, ge=1, text="elements of b")


class Pairs:
    """The base of blocks with two vectors and the one that they make."""

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``n`` is the sum of ``n_a`` and ``n_b``."""
        assert isinstance(params, PairSizes)
        return {"n_a": params.n_a, "n_b": params.n_b, "n": params.n_a + params.n_b}
