"""Linear systems: state space and transfer functions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.kernel import kernel
from ...mathematics.linear_systems import advance_transfer_function, controllable_form, discretise
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import InputQuantities, OutputQuantities
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import read_unit
from .vectors import (
    InUnit,
    Matrix,
    SourceParameters,
    Vector,
    VectorParameters,
    VectorUnits,
    matrix_rows,
    said,
)


class SystemInput(Signal):
    """The input of a linear system, a vector of ``n`` numbers."""

    value = Field("n", inferred=True, text="the inputs")


class SystemOutput(Signal):
    """The output of a linear system, a vector of ``m`` numbers."""

    value = Field("m", inferred=True, text="the outputs")


class SystemState(Signal):
    """The state of a linear system, a vector of ``order`` numbers."""

    value = Field("order", text="the system's state")


class SystemParameters(SourceParameters, VectorUnits):
    """A linear system in state space. ``unit`` and ``frame`` are those of its outputs, whose units
    ``output_units`` gives one by one."""

    a: Matrix = parameter(text="A, order x order, as a list of rows", min_length=1)
    b: Matrix = parameter(text="B, order x inputs", min_length=1)
    c: Matrix = parameter(text="C, outputs x order", min_length=1)
    initial: list[float] | None = parameter(None, text="the state at the start; else zero")
    time: Literal["discrete", "continuous"] = parameter(
        "discrete",
        text="A and B give the next state (discrete), or its rate (continuous): then they are discretised exactly",
    )

    _rows = matrix_rows("a", "b", "c")

    def sizes(self) -> Mapping[str, int]:
        """Return the dimensions ``n`` (inputs), ``m`` (outputs) and ``order``."""
        return {"n": len(self.b[0]), "m": len(self.c), "order": len(self.a)}

    def wrong_sizes(self) -> Iterable[UnmetRequirement]:
        """Matrices and initial values that do not fit A."""
        order = len(self.a)
        yield from _unequal("a", "columns", len(self.a[0]), order)
        yield from _unequal("b", "rows", len(self.b), order)
        yield from _unequal("c", "columns", len(self.c[0]), order)
        if self.initial is not None:
            yield from _unequal("initial", "elements", len(self.initial), order)
        yield from self.wrong_units(len(self.b[0]), len(self.c))

    def matrices(self, period: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the discrete A and B of a period [s]."""
        if self.time == "discrete":
            return np.array(self.a), np.array(self.b)
        return discretise(self.a, self.b, period)


class DiscreteSystem(Signal):
    """The matrices of the next state."""

    a = Field(("order", "order"), text="A of a period")
    b = Field(("order", "n"), text="B of a period")


class NextState(Signal):
    """Scratch memory of the next state."""

    next = Field("order", text="the next state")


@kernel
def advance_state(
    u: SystemInput, x: SystemState, constants: DiscreteSystem, scratch: NextState
) -> None:
    """Go on to the next state."""
    scratch.next[:] = constants.a @ x.value + constants.b @ u.value
    x.value[:] = scratch.next


class LinearSystem(Block):
    """The base of the linear systems in state space."""

    Params = SystemParameters
    Constants = DiscreteSystem
    Scratch = NextState
    params: SystemParameters
    u = Input(SystemInput, text="the inputs")
    y = Output(SystemOutput, text="the outputs")
    x = State(SystemState, text="the system's state")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """``n`` inputs, ``m`` outputs and the ``order``."""
        assert isinstance(params, SystemParameters)
        return params.sizes()

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report matrices that do not fit each other."""
        assert isinstance(params, SystemParameters)
        return params.wrong_sizes()

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Check the inputs, and return what the parameters say of the outputs."""
        assert isinstance(params, SystemParameters)
        params.check_inputs(inputs)
        if params.output_units is None:
            return {"y": params.quantity()}
        return {"y": said(params.output_units, params.frame)}

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Return a damped oscillator with two inputs and one output."""
        return {
            "a": [[0.0, 1.0], [-4.0, -0.5]],
            "b": [[0.0, 1.0], [1.0, 0.0]],
            "c": [[1.0, 0.0]],
            "time": "continuous",
        }

    def setup(self) -> None:
        if self.params.initial is not None:
            self.x.value[...] = self.params.initial

    def prepare(self) -> None:
        a, b = self.params.matrices(self.period)
        self.constants.a[...] = a
        self.constants.b[...] = b


def _unequal(name: str, what: str, found: int, order: int) -> Iterable[UnmetRequirement]:
    if found != order:
        yield UnmetRequirement(
            f"{name} has {found} {what}, and the system is of order {order}",
            parameter=name,
            expected=f"{order} {what}",
            found=str(found),
        )


class StateSpace(LinearSystem):
    """A linear system: y[n] = C x[n], x[n+1] = A x[n] + B u[n], x[0] = initial.

    With ``time: continuous`` A and B are those of dx/dt = A x + B u, discretised exactly for an
    input that is held over the block's period, by the matrix exponential. A Moore block, so it
    breaks a loop; ``StateSpaceWithFeedthrough`` has a matrix D as well and does not.
    """

    @kernel
    @staticmethod
    def emit(y: SystemOutput, x: SystemState, params: SystemParameters) -> None:
        y.value[:] = params.c @ x.value

    @kernel
    @staticmethod
    def update(
        u: SystemInput, x: SystemState, constants: DiscreteSystem, scratch: NextState
    ) -> None:
        advance_state(u, x, constants, scratch)


class StateSpaceWithFeedthrough(LinearSystem):
    """A linear system: y[n] = C x[n] + D u[n], x[n+1] = A x[n] + B u[n], x[0] = initial.

    With ``time: continuous`` A and B are those of dx/dt = A x + B u, discretised exactly for an
    input that is held over the block's period. Outputs follow from the inputs of the same tick.
    """

    class Params(SystemParameters):
        d: Matrix = parameter(text="D, outputs x inputs", min_length=1)

        _d_rows = matrix_rows("d")

    params: Params

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report matrices that do not fit each other."""
        assert isinstance(params, cls.Params)
        yield from params.wrong_sizes()
        found = f"{len(params.d)} x {len(params.d[0])}"
        expected = f"{len(params.c)} x {len(params.b[0])}"
        if found != expected:
            yield UnmetRequirement("d does not fit b and c", "d", expected=expected, found=found)

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Return an oscillator with feedthrough."""
        return {**super().example_parameters(), "d": [[0.5, -1.0]]}

    @kernel
    @staticmethod
    def step(
        u: SystemInput,
        y: SystemOutput,
        x: SystemState,
        params: Params,
        constants: DiscreteSystem,
        scratch: NextState,
    ) -> None:
        y.value[:] = params.c @ x.value + params.d @ u.value
        advance_state(u, x, constants, scratch)


class TransferState(Signal):
    """The states of one transfer function for each element."""

    value = Field(("n", "order"), text="states in the controllable canonical form")


class TransferFunction(Block):
    """A proper rational transfer function, the same for every element, from rest.

    Coefficients are of falling powers, of s for a continuous function and of z for a discrete one:
    ``numerator: [1], denominator: [0.1, 1]`` is 1 / (0.1 s + 1). A continuous one is discretised
    exactly for an input that is held over the block's period, by the matrix exponential of its
    controllable canonical form. Outputs follow from inputs of the same tick; for a loop around a
    strictly proper system use ``StateSpace``. Units are given as that of the function, ``unit: rad/s/V``, or as
    those of its ends, ``input_units: V`` and ``output_units: rad/s``.
    """

    class Params(VectorParameters, InUnit, VectorUnits):
        numerator: list[float] = parameter(text="coefficients of falling powers", min_length=1)
        denominator: list[float] = parameter(text="coefficients of falling powers", min_length=2)
        time: Literal["continuous", "discrete"] = parameter(
            "continuous", text="variable of the function: s or z"
        )

    class Constants(Signal):
        """The discrete system in controllable canonical form."""

        a = Field(("order", "order"), text="A")
        b = Field("order", text="B")
        c = Field("order", text="C")
        d = Field(text="D")

    Scratch = NextState
    params: Params
    u = Input(Vector, text="the signal to filter")
    y = Output(Vector, text="u, filtered")
    x = State(TransferState, text="the states")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """``n`` elements, and the ``order``."""
        assert isinstance(params, cls.Params)
        return {"n": params.n, "order": len(params.denominator) - 1}

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a function that is not proper, or a denominator without the degree it seems to have."""
        assert isinstance(params, cls.Params)
        yield from params.wrong_units(params.n, params.n)
        if params.denominator[0] == 0.0:
            yield UnmetRequirement("the denominator's first coefficient is zero", "denominator")
        if len(params.numerator) > len(params.denominator):
            yield UnmetRequirement(
                "it is not proper: the numerator's degree is above the denominator's",
                parameter="numerator",
                expected=f"at most {len(params.denominator)} coefficients",
                found=str(len(params.numerator)),
            )

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Check the input, and return the units that are said of y, or u times the unit of the function."""
        assert isinstance(params, cls.Params)
        u = inputs["u"]
        if params.input_units is not None:
            params.check_inputs(inputs)
        if params.output_units is not None:
            return {"y": said(params.output_units, u.frame if u else None)}
        return {"y": u and u.times(read_unit(params.unit))}

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Return a damped second-order system with feedthrough."""
        return {"n": 2, "numerator": [0.1, 1.0, 4.0], "denominator": [1.0, 2.0, 4.0]}

    def prepare(self) -> None:
        p = self.params
        a, b, c, d = controllable_form(p.numerator, p.denominator)
        if p.time == "continuous":
            a, b = discretise(a.tolist(), b.tolist(), self.period)
        self.constants.a[...], self.constants.b[...] = a, b[:, 0]
        self.constants.c[...], self.constants.d = c[0], d

    @kernel
    @staticmethod
    def step(
        u: Vector, y: Vector, x: TransferState, constants: Constants, scratch: NextState
    ) -> None:
        advance_transfer_function(
            constants.a,
            constants.b,
            constants.c,
            float(constants.d),
            u.value,
            x.value,
            scratch.next,
            y.value,
        )
