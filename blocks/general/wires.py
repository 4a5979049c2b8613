"""Vectors joined, split and selected from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Context, Input, Output, UnmetRequirement
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import InputQuantities, OutputQuantities, Quantity
from ...runtime.language.signals import Field, Signal
from .vectors import Vector


class First(Signal):
    """A vector of ``n_a`` numbers."""

    value = Field("n_a", inferred=True, text="the first elements")


class Second(Signal):
    """A vector of ``n_b`` numbers."""

    value = Field("n_b", inferred=True, text="the elements behind them")


class JoinedVector(Signal):
    """A vector of ``n_a + n_b`` numbers."""

    value = Field("n", inferred=True, text="first those of a, then those of b")


class PairSizes(Parameters):
    """The sizes of two vectors that make one."""

    n_a: int = parameter(1, ge=1, text="elements of a")
    n_b: int = parameter(1, ge=1, text="elements of b")


class Pairs:
    """The base of blocks with two vectors and the one that they make."""

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """``n`` is the sum of ``n_a`` and ``n_b``."""
        assert isinstance(params, PairSizes)
        return {"n_a": params.n_a, "n_b": params.n_b, "n": params.n_a + params.n_b}


class Mux(Pairs, Block):
    """Two vectors one behind the other: y = [a, b]. More are joined by several such blocks."""

    Params = PairSizes
    params: PairSizes
    a = Input(First, text="the first elements")
    b = Input(Second, text="the elements behind them")
    y = Output(JoinedVector, text="all elements")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the quantity that both have in common; where they differ each element keeps its own unit."""
        assert isinstance(params, PairSizes)
        a, b = inputs["a"], inputs["b"]
        if a is None or b is None:
            return {}
        frame = a.frame if a.frame == b.frame else None
        return {"y": Quantity.of((*a.units(params.n_a), *b.units(params.n_b)), frame)}

    @kernel
    @staticmethod
    def step(a: First, b: Second, y: JoinedVector, params: PairSizes) -> None:
        y.value[: params.n_a] = a.value
        y.value[params.n_a :] = b.value


class Demux(Pairs, Block):
    """The first ``n_a`` elements and the ``n_b`` behind them: [a, b] = u."""

    Params = PairSizes
    params: PairSizes
    u = Input(JoinedVector, text="the vector to split")
    a = Output(First, text="the first elements")
    b = Output(Second, text="the elements behind them")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Both are what u is; where its elements have unlike units, they keep their own."""
        assert isinstance(params, PairSizes)
        u = inputs["u"]
        if u is None or not u.elements:
            return {"a": u, "b": u}
        first, second = u.elements[: params.n_a], u.elements[params.n_a :]
        return {"a": Quantity.of(first, u.frame), "b": Quantity.of(second, u.frame)}

    @kernel
    @staticmethod
    def step(u: JoinedVector, a: First, b: Second, params: PairSizes) -> None:
        a.value[:] = u.value[: params.n_a]
        b.value[:] = u.value[params.n_a :]


class Selected(Signal):
    """The ``m`` elements that were selected."""

    value = Field("m", inferred=True, text="the elements, in the order asked for")


class Selector(Block):
    """Some elements of the input, in any order, also repeated: y[i] = u[elements[i]], from 0."""

    class Params(Parameters):
        n: int = parameter(ge=1, text="elements of the input")
        elements: list[int] = parameter(
            text="indices of the elements, counted from 0", min_length=1
        )

    params: Params
    u = Input(Vector, text="the vector to select from")
    y = Output(Selected, text="the selected elements")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """``n`` elements come in and ``m`` go out."""
        assert isinstance(params, cls.Params)
        return {"n": params.n, "m": len(params.elements)}

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the quantity of u, or of those of its elements that are selected."""
        assert isinstance(params, cls.Params)
        u = inputs["u"]
        if u is None or not u.elements:
            return {"y": u}
        taken = (u.elements[k] for k in params.elements if 0 <= k < len(u.elements))
        return {"y": Quantity.of(taken, u.frame)}

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Every element that is selected must be there."""
        assert isinstance(params, cls.Params)
        for element in params.elements:
            if not 0 <= element < params.n:
                yield UnmetRequirement(
                    f"element {element} is not there",
                    parameter="elements",
                    expected=f"0 to {params.n - 1}",
                    found=str(element),
                )

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Two of three."""
        return {"n": 3, "elements": [2, 0]}

    @kernel
    @staticmethod
    def step(u: Vector, y: Selected, params: Params) -> None:
        for i in range(y.value.shape[0]):
            y.value[i] = u.value[params.elements[i]]
