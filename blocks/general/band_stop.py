"""A filter that takes out one frequency."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ...mathematics.linear_systems import band_stop
from ...runtime.language.block import Context, Misfit
from ...runtime.language.parameters import Parameters, parameter
from .elements import Elements
from .linear_filter import LinearFilter, too_fast


class BandStop(LinearFilter):
    """A notch: (s^2 + w^2) / (s^2 + v s + w^2) by the prewarped bilinear transform.

    w = 2 pi centre and v = 2 pi width. Nothing passes at the centre, and of the frequencies around
    it those within about ``width`` are damped by more than 1 / sqrt(2). It begins settled at the
    first input.
    """

    class Params(Elements):
        centre: float = parameter(unit="Hz", gt=0.0, text="the frequency that is taken out")
        width: float = parameter(1.0, unit="Hz", gt=0.0, text="how broad the notch is")

    params: Params

    @classmethod
    def requires_of_graph(cls, params: Parameters, context: Context) -> Iterable[Misfit]:
        """The centre must be below half of the block's rate."""
        assert isinstance(params, cls.Params)
        return too_fast("centre", params.centre, context.period)

    @classmethod
    def example_parameters(cls) -> dict[str, object]:
        """A centre far below the rate."""
        return {"centre": 50.0, "n": 2}

    def coefficients(self, out: NDArray[np.float64]) -> None:
        """Those of the notch."""
        band_stop(self.params.centre, self.params.width, self.period, out)
