"""Numbers that somebody sets while the graph runs."""

from __future__ import annotations

from collections.abc import Iterable

from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Context, Output, UnmetRequirement
from ...runtime.language.parameters import (
    Parameters,
    ScalarOrVector,
    live_parameter,
    parameter,
)
from .vectors import SourceParameters, UnitFromParameters, Vector, VectorParameters


class Slider(UnitFromParameters, Block):
    """A number from the live view: y = min(max(value, lower), upper), from tick to tick.

    The page of ``aloft graph --live`` has a slider from ``lower`` to ``upper`` for it, one for each of
    ``n`` elements; ``aloft params set`` moves it, too. Moves are recorded and replayed as every live
    parameter is.
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = ("value", "lower", "upper")

        value: ScalarOrVector = live_parameter(0.0, text="where the slider is")
        lower: float = parameter(-1.0, text="its lower end")
        upper: float = parameter(1.0, text="its upper end")

        def live_range(self, name: str) -> tuple[float, float]:
            """Return the ends of the slider on the page."""
            return self.lower, self.upper

    params: Params
    y = Output(Vector, text="the value, within its ends")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report ends that cross."""
        assert isinstance(params, cls.Params)
        if params.lower > params.upper:
            yield UnmetRequirement(
                "the lower end is above the upper one",
                parameter="lower",
                expected=f"at most {params.upper:g}",
                found=f"{params.lower:g}",
            )

    @kernel
    @staticmethod
    def step(y: Vector, params: Params) -> None:
        y.value[:] = params.value
        y.value[:] = min(params.upper, max(params.lower, y.value))
