"""What the Butterworth filters share: a cutoff and an order."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.linear_systems import first_order, second_order
from ...runtime.language.block import Context, Misfit
from ...runtime.language.parameters import Parameters, parameter
from .elements import Elements
from .linear_filter import LinearFilter, too_fast


class ButterworthParameters(Elements):
    """A cutoff and an order."""

    cutoff: float = parameter(unit="Hz", gt=0.0, text="where the gain is 1 / sqrt(2)")
    order: Literal[1, 2] = parameter(
        1, text="beyond the cutoff the gain falls by 20 dB a decade with 1, by 40 dB with 2"
    )


class Butterworth(LinearFilter):
    """The base of the Butterworth filters of first or second order.

    They are made by the prewarped bilinear transform.
    """

    Params = ButterworthParameters
    params: ButterworthParameters

    @classmethod
    def requires_of_graph(cls, params: Parameters, context: Context) -> Iterable[Misfit]:
        """The cutoff must be below half of the block's rate."""
        assert isinstance(params, ButterworthParameters)
        return too_fast("cutoff", params.cutoff, context.period)

    @classmethod
    def example_parameters(cls) -> dict[str, object]:
        """A cutoff far below the rate."""
        return {"cutoff": 20.0, "n": 2, "order": 2}

    @abstractmethod
    def coefficients(self, out: NDArray[np.float64]) -> None:
        """Those of ``design``, for slow changes or for fast ones."""

    def design(self, passes_fast: bool, out: NDArray[np.float64]) -> None:
        """Write the coefficients of the order asked for."""
        cutoff, order = self.params.cutoff, self.params.order
        if order == 1:
            first_order(cutoff, self.period, passes_fast, out)
        else:
            second_order(cutoff, math.sqrt(0.5), self.period, passes_fast, out)
