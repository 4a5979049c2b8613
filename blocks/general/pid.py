"""A PID controller."""

from __future__ import annotations

from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, ScalarOrVector, live_parameter
from ...runtime.language.quantities import InputQuantities, OutputQuantities
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import SECOND, read_unit, times
from .vectors import (
    NEVER,
    Bounded,
    Bounds,
    Flag,
    InUnit,
    Vector,
    VectorParameters,
)


class PidState(Signal):
    """Memory of a PID controller."""

    integral = Field("n", text="the integral part")
    derivative = Field("n", text="the derivative part")
    before = Field("n", text="c r - y of the run before")
    started = Field((), dtype="bool", text="there was a run since the start or a reset")


class PID(Bounded, Block):
    """A PID controller for every element, with bounds, anti-windup and setpoint weights.

    With setpoint r, measurement y, feedforward f and the block's period T:

    * P = kp (b r - y);
    * D[n] = (tau D[n-1] + kd (d[n] - d[n-1])) / (tau + T) with d = c r - y (backward differences);
    * v = P + I[n] + D[n] + f, and the output is u = min(max(v, lower), upper);
    * I[n+1] = I[n] + T ki (r - y) + share (u - v), the back-calculation that undoes windup, with
      share = min(T / tracking_time, 1), and no share where ki is 0 and there is nothing to wind up.

    I[0] = 0 and D = 0 in the first run and where ``reset`` holds. (Astrom and Hagglund, Advanced PID
    Control, chapter 3.)

    ``unit`` is the unit of kp: N m/rad, if r and y are angles and u is a torque. ki is in it per
    second, and kd in it times seconds.
    """

    class Params(VectorParameters, InUnit):
        in_unit = ("kp",)

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
            0.1, unit="s", gt=0.0, text="time constant with which the integral gives way to a bound"
        )
        lower: ScalarOrVector | None = live_parameter(None, text="the least output")
        upper: ScalarOrVector | None = live_parameter(None, text="the greatest output")

        def own_unit(self, name: str) -> str:
            """Return the unit of a gain, as the class's text says."""
            unit = read_unit(self.unit)
            if unit is None or name not in ("kp", "ki", "kd"):
                return ""
            return str(times(unit, SECOND, {"kp": 0, "ki": -1, "kd": 1}[name]))

    class Constants(Bounds):
        """The bounds, and what follows from the other parameters."""

        tracking = Field(
            text="the share of what a bound cut off that the integral takes back in a run"
        )

    params: Params
    setpoint = Input(Vector, text="r, what is wanted")
    measured = Input(Vector, text="y, what is")
    feedforward = Input(Vector, text="f, added before the bounds", default={"value": 0.0})
    reset = Input(Flag, text="forgets the past", default=NEVER)
    u = Output(Vector, text="the control, within the bounds")
    x = State(PidState, text="the integral and the derivative")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """u has the unit of the error times ``unit``, which the feedforward must have too."""
        assert isinstance(params, cls.Params)
        error = inputs.alike("setpoint", "measured")
        u = error and error.times(read_unit(params.unit))
        inputs.agree("feedforward", u, "it is added to the control")
        return {"u": u}

    def prepare(self) -> None:
        super().prepare()
        self.constants.tracking = min(self.period / self.params.tracking_time, 1.0)

    @kernel
    @staticmethod
    def step(
        setpoint: Vector,
        measured: Vector,
        feedforward: Vector,
        reset: Flag,
        u: Vector,
        x: PidState,
        params: Params,
        constants: Constants,
        period: float,
    ) -> None:
        tau = params.derivative_time_constant
        starts = reset.value or not x.started
        x.started = True
        for i in range(u.value.shape[0]):
            r, y = setpoint.value[i], measured.value[i]
            d = params.c[i] * r - y
            if starts:
                x.integral[i] = 0.0
                x.derivative[i] = 0.0
                x.before[i] = d
            x.derivative[i] = (tau * x.derivative[i] + params.kd[i] * (d - x.before[i])) / (
                tau + period
            )
            x.before[i] = d
            p = params.kp[i] * (params.b[i] * r - y)
            v = p + x.integral[i] + x.derivative[i] + feedforward.value[i]
            u.value[i] = min(max(v, constants.lower[i]), constants.upper[i])
            if params.ki[i] != 0.0:
                x.integral[i] = (
                    x.integral[i]
                    + period * params.ki[i] * (r - y)
                    + constants.tracking * (u.value[i] - v)
                )
