"""Small general blocks on plain vectors: for tests, tutorials and the odd signal in between.

``n``, the length of a vector, is a parameter of each block. Units and frames are not checked.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.errors import BlockError
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal


class Vector(Signal):
    """n numbers without a unit."""

    value = Field("n", text="the numbers")


class Constant(Block):
    """The same vector for ever: y[n] = value. It has as many elements as ``value``."""

    class Params(Parameters):
        value: list[float] = live_parameter(text="the vector", min_length=1)

    params: Params
    y = Output(Vector, text="the vector")

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``n`` is the length of ``value``."""
        assert isinstance(params, cls.Params)
        return {"n": len(params.value)}

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Three numbers."""
        return {"value": [1.0, -2.0, 0.5]}

    def setup(self) -> None:
        """Make the vector."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """Make it anew."""
        self._value = np.array(self.params.value)

    def step(self) -> None:
        """Write it."""
        np.copyto(self.y.value, self._value)


class Gain(Block):
    """The input times a constant: y = gain u."""

    class Params(Parameters):
        n: int = parameter(1, ge=1, text="elements")
        gain: float = live_parameter(1.0, text="the factor")

    params: Params
    u = Input(Vector, text="what is scaled")
    y = Output(Vector, text="gain times u")

    def setup(self) -> None:
        """Keep the factor at hand."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """As an array, so that no tick makes one."""
        self._gain = np.array(self.params.gain)

    def step(self) -> None:
        """Multiply."""
        np.multiply(self.u.value, self._gain, out=self.y.value)


class Sum(Block):
    """The weighted sum of two inputs: y = weights[0] a + weights[1] b; [1, -1] subtracts."""

    class Params(Parameters):
        n: int = parameter(1, ge=1, text="elements")
        weights: list[float] = live_parameter(
            [1.0, 1.0], min_length=2, max_length=2, text="factors of a and b"
        )

    params: Params
    a = Input(Vector, text="the first")
    b = Input(Vector, text="the second")
    y = Output(Vector, text="the sum")

    def setup(self) -> None:
        """Keep the factors at hand."""
        self._product = np.zeros(self.params.n)
        self.on_parameters()

    def on_parameters(self) -> None:
        """As arrays, so that no tick makes them."""
        self._first, self._second = (np.array(weight) for weight in self.params.weights)

    def step(self) -> None:
        """Add."""
        np.multiply(self.b.value, self._second, out=self._product)
        np.multiply(self.a.value, self._first, out=self.y.value)
        np.add(self.y.value, self._product, out=self.y.value)


class InitialParameters(Parameters):
    """The parameters of blocks that start from a vector."""

    n: int = parameter(1, ge=1, text="elements")
    initial: float | list[float] = parameter(
        0.0, text="the first output: n numbers, or one for all elements"
    )

    def start_value(self) -> NDArray[np.float64]:
        """``initial`` as an array. Raises ``BlockError`` if it has not n elements."""
        value = np.asarray(self.initial, np.float64)
        if value.shape not in ((), (self.n,)):
            raise BlockError(f"initial has {value.size} elements, expected n = {self.n}")
        return value


class UnitDelay(Block):
    """The input of the run before: y[n] = x[n], x[n+1] = u[n], x[0] = initial.

    A Moore block, so it breaks a loop. Raises ``BlockError`` if ``initial`` has not n elements.
    """

    Params = InitialParameters
    params: InitialParameters
    u = Input(Vector, text="what is delayed")
    y = Output(Vector, text="u one run ago")
    x = State(Vector, text="u of the last run")

    def setup(self) -> None:
        """Start from the initial value."""
        self.x.value[...] = self.params.start_value()

    def emit(self) -> None:
        """Write what is remembered."""
        np.copyto(self.y.value, self.x.value)

    def update(self) -> None:
        """Remember the input."""
        np.copyto(self.x.value, self.u.value)


class Integrator(Block):
    """The time integral by forward Euler: y[n] = x[n], x[n+1] = x[n] + T u[n], x[0] = initial.

    T is the block's period. A Moore block, so it breaks a loop. Raises ``BlockError`` if
    ``initial`` has not n elements.
    """

    Params = InitialParameters
    params: InitialParameters
    u = Input(Vector, text="the rate")
    y = Output(Vector, text="its integral")
    x = State(Vector, text="the integral")

    def setup(self) -> None:
        """Start from the initial value."""
        self.x.value[...] = self.params.start_value()
        self._step = np.zeros(self.params.n)
        self._period = np.array(self.period)

    def emit(self) -> None:
        """Write the integral so far."""
        np.copyto(self.y.value, self.x.value)

    def update(self) -> None:
        """Take one Euler step."""
        np.multiply(self.u.value, self._period, out=self._step)
        np.add(self.x.value, self._step, out=self.x.value)


class SineWave(Block):
    """A sine of time in every element: y = offset + amplitude sin(2 pi frequency t + phase)."""

    class Params(Parameters):
        n: int = parameter(1, ge=1, text="elements")
        amplitude: float = live_parameter(1.0, text="half of peak to peak")
        frequency: float = live_parameter(1.0, unit="Hz", ge=0.0, text="oscillations per second")
        phase: float = live_parameter(0.0, unit="rad", text="angle at time zero")
        offset: float = live_parameter(0.0, text="the mean")

    params: Params
    y = Output(Vector, text="the sine")

    def step(self) -> None:
        """Evaluate at the present time."""
        p = self.params
        angle = 2.0 * math.pi * p.frequency * self.time + p.phase
        self.y.value.fill(p.offset + p.amplitude * math.sin(angle))
