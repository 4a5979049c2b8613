"""Some elements of a vector."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .quantity_parameters import Keeps
from .vector import Vector


class Selected(Signal):
    """The ``m`` elements that were selected."""

    value = Field("m", carried=True, text="the elements, in the order asked for")


class Selector(Keeps, Block):
    """Some elements of the input, in any order, also repeated: y[i] = u[elements[i]], from 0."""

    class Params(Parameters):
        n: int = parameter(ge=1, text="elements of the input")
        elements: list[int] = parameter(text="which elements, counted from 0", min_length=1)

    params: Params
    u = Input(Vector, text="what is selected from")
    y = Output(Selected, text="the selected elements")

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``n`` elements come in and ``m`` go out."""
        assert isinstance(params, cls.Params)
        return {"n": params.n, "m": len(params.elements)}

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """Every element that is selected must be there."""
        assert isinstance(params, cls.Params)
        for element in params.elements:
            if not 0 <= element < params.n:
                yield Misfit(
                    f"element {element} is not there",
                    parameter="elements",
                    expected=f"0 to {params.n - 1}",
                    found=str(element),
                )

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Two of three."""
        return {"n": 3, "elements": [2, 0]}

    def setup(self) -> None:
        """Keep the places at hand."""
        self._places = np.array(self.params.elements)

    def step(self) -> None:
        """Select."""
        np.take(self.u.value, self._places, out=self.y.value, mode="clip")
