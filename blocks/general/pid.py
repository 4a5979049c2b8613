"""A PID controller."""

from __future__ import annotations

import numpy as np

from ...mathematics.pid import PidGains, PidMemory, start_pid, step_pid
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.quantities import Carried, Given
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import read_unit
from .vectors import (
    NEVER,
    Bounded,
    Flag,
    InUnit,
    ScalarOrVector,
    Vector,
    VectorParameters,
    broadcast,
    broadcast_bound,
)


class Memory(Signal):
    """What a PID controller remembers."""

    integral = Field("n", text="the integral part")
    derivative = Field("n", text="the derivative part")
    before = Field("n", text="c r - y of the run before")
    started = Field((), dtype="bool", text="whether there was a run since the start or a reset")


class PID(Bounded, Block):
    """A PID controller for every element, with bounds, anti-windup and setpoint weights.

    With setpoint r, measurement y, feedforward f and the block's period T:

    * P = kp (b r - y);
    * D[n] = (tau D[n-1] + kd (d[n] - d[n-1])) / (tau + T) with d = c r - y (backward differences);
    * v = P + I[n] + D[n] + f, and the output is u = min(max(v, lower), upper);
    * I[n+1] = I[n] + T ki (r - y) + share (u - v), the back-calculation that undoes windup, with
      share = min(T / tracking_time, 1).

    I[0] = 0 and D = 0 in the first run and where ``reset`` holds. (Astrom and Hagglund, Advanced PID
    Control, chapter 3.)

    ``unit`` is the unit of kp: N m/rad, if r and y are angles and u is a torque. ki is in it per
    second, and kd in it times seconds.
    """

    class Params(VectorParameters, InUnit):
        kp: ScalarOrVector = live_parameter(1.0, text="proportional gain")
        ki: ScalarOrVector = live_parameter(0.0, text="integral gain, per second")
        kd: ScalarOrVector = live_parameter(0.0, text="derivative gain, in seconds")
        b: ScalarOrVector = live_parameter(
            1.0, text="the setpoint's weight in the proportional part"
        )
        c: ScalarOrVector = live_parameter(0.0, text="the setpoint's weight in the derivative part")
        derivative_time_constant: float = live_parameter(
            0.01, unit="s", ge=0.0, text="tau, of the derivative's filter"
        )
        tracking_time: float = live_parameter(
            0.1, unit="s", gt=0.0, text="how fast the integral gives way to a bound"
        )
        lower: ScalarOrVector | None = live_parameter(None, text="the least output")
        upper: ScalarOrVector | None = live_parameter(None, text="the greatest output")

    params: Params
    setpoint = Input(Vector, text="r, what is wanted")
    measured = Input(Vector, text="y, what is")
    feedforward = Input(Vector, text="f, added before the bounds", default={"value": 0.0})
    reset = Input(Flag, text="whether to forget what was", default=NEVER)
    u = Output(Vector, text="the control, within the bounds")
    x = State(Memory, text="the integral and the derivative")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """u has the unit of the error times ``unit``, which the feedforward must have too."""
        assert isinstance(params, cls.Params)
        error = given.alike("setpoint", "measured")
        u = error and error.times(read_unit(params.unit))
        given.agree("feedforward", u, "it is added to the control")
        return {"u": u}

    def setup(self) -> None:
        """Keep gains and memory at hand."""
        x = self.x
        self._memory = PidMemory(x.integral, x.derivative, x.before)
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep the gains as arrays."""
        p = self.params
        self._gains = PidGains(
            broadcast(p.kp, p.n),
            broadcast(p.ki, p.n),
            broadcast(p.kd, p.n),
            broadcast(p.b, p.n),
            broadcast(p.c, p.n),
            broadcast_bound(p.lower, p.n, -np.inf),
            broadcast_bound(p.upper, p.n, np.inf),
            p.derivative_time_constant,
            min(self.period / p.tracking_time, 1.0),
            self.period,
        )

    def step(self) -> None:
        """Control."""
        r, y = self.setpoint.value, self.measured.value
        if self.reset.value or not self.x.started:
            start_pid(self._gains, r, y, self._memory)
            self.x.started[...] = True
        step_pid(self._gains, r, y, self.feedforward.value, self._memory, self.u.value)
