"""A filter that passes fast changes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.second_order_filter import first_order, second_order
from ...runtime.language.block import Context, Misfit
from ...runtime.language.parameters import Parameters, parameter
from .elements import Elements
from .linear_filter import LinearFilter, too_fast


class HighPass(LinearFilter):
    """A Butterworth high-pass of first or second order, by the prewarped bilinear transform.

    With w = 2 pi cutoff it is (s / w) / (1 + s / w), or s^2 / (s^2 + sqrt(2) w s + w^2). At the
    cutoff the gain is 1 / sqrt(2). It begins settled at the first input, so the first output is 0.
    """

    class Params(Elements):
        cutoff: float = parameter(unit="Hz", gt=0.0, text="where the gain is 1 / sqrt(2)")
        order: Literal[1, 2] = parameter(1, text="1 rises by 20 dB a decade, 2 by 40 dB")

    params: Params

    @classmethod
    def requires_of_graph(cls, params: Parameters, context: Context) -> Iterable[Misfit]:
        """The cutoff must be below half of the block's rate."""
        assert isinstance(params, cls.Params)
        return too_fast("cutoff", params.cutoff, context.period)

    @classmethod
    def example_parameters(cls) -> dict[str, object]:
        """A cutoff far below the rate."""
        return {"cutoff": 20.0, "n": 2, "order": 2}

    def coefficients(self, out: NDArray[np.float64]) -> None:
        """Those of the order asked for."""
        if self.params.order == 1:
            first_order(self.params.cutoff, self.period, True, out)
        else:
            second_order(self.params.cutoff, math.sqrt(0.5), self.period, True, out)
