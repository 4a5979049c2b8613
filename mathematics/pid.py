"""One step of a PID controller for every element of a vector."""

from __future__ import annotations

from typing import NamedTuple

from .arrays import Array
from .kernel import kernel


class PidGains(NamedTuple):
    """Gains of n controllers, arrays (n), and what they share."""

    proportional: Array
    integral: Array
    derivative: Array
    setpoint: Array
    """The setpoint's weight b in the proportional part."""
    setpoint_rate: Array
    """The setpoint's weight c in the derivative part."""
    lower: Array
    upper: Array
    smoothing: float
    """The time constant of the derivative's filter [s]."""
    tracking: float
    """The share of what saturation cut off that the integral takes back in one step."""
    period: float
    """[s]"""


class PidMemory(NamedTuple):
    """What n controllers remember, arrays (n)."""

    integral: Array
    derivative: Array
    before: Array
    """c r - y of the step before."""


@kernel
def start_pid(gains: PidGains, setpoint: Array, measured: Array, memory: PidMemory) -> None:
    """Empty the memory, so that the first derivative is zero."""
    for i in range(setpoint.shape[0]):
        memory.integral[i] = 0.0
        memory.derivative[i] = 0.0
        memory.before[i] = float(gains.setpoint_rate[i]) * float(setpoint[i]) - float(measured[i])


@kernel
def step_pid(
    gains: PidGains,
    setpoint: Array,
    measured: Array,
    feedforward: Array,
    memory: PidMemory,
    out: Array,
) -> None:
    """Write the bounded control into ``out`` (n) and advance the memory."""
    whole = gains.smoothing + gains.period
    for i in range(setpoint.shape[0]):
        r, y = float(setpoint[i]), float(measured[i])
        now = float(gains.setpoint_rate[i]) * r - y
        rate = float(gains.derivative[i]) * (now - float(memory.before[i]))
        derivative = (gains.smoothing * float(memory.derivative[i]) + rate) / whole
        integral = float(memory.integral[i])
        wanted = (
            float(gains.proportional[i]) * (float(gains.setpoint[i]) * r - y)
            + integral
            + derivative
            + float(feedforward[i])
        )
        given = min(max(wanted, float(gains.lower[i])), float(gains.upper[i]))
        memory.integral[i] = (
            integral
            + gains.period * float(gains.integral[i]) * (r - y)
            + gains.tracking * (given - wanted)
        )
        memory.derivative[i] = derivative
        memory.before[i] = now
        out[i] = given
