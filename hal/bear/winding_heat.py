"""Temperature rise of the motor windings in a jump, and their cooling time before it.

A jump's copper heat follows from the torques of its plan, by the motor's own torque constant k and the
resistance R at its temperature, and warms the winding's heat capacity C; cooling meanwhile is left out::

    rise = m R (1 + a (T - 25)) / (k^2 C) * integral of torque^2 dt

The margin m is for what a run adds to its plan: the robot stands before and after, and lands harder. Where
no plan is known the rise is ``drives.jump_heating``. A winding cools towards the temperature T_a of its coolant with
the time constant R_th C.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ...mathematics.constants import COPPER
from .configuration import Hardware

_NOMINAL = 25.0
"""The temperature at which the resistance of the hardware's file holds [deg C]."""


@dataclass(frozen=True)
class HotWinding:
    """A winding that the next jump would overheat.

    Attributes:
        motor: its name.
        temperature: now [deg C].
        rise: by the jump [K].
        limit: the highest temperature [deg C].
        planned: whether the rise is that of a plan.
        wait: the time in which it cools far enough [s]; ``None``: never.
    """

    motor: str
    temperature: float
    rise: float
    limit: float
    planned: bool
    wait: float | None

    def __str__(self) -> str:
        """Return the winding in words."""
        what = "the plan" if self.planned else "a jump (`drives.jump_heating`)"
        end = self.temperature + self.rise
        return (
            f"{self.motor} has {self.temperature:.1f} deg C, and {what} heats it by {self.rise:.1f} to {end:.1f}: "
            f"more than {self.limit:g}; {self._remedy}"
        )

    @property
    def _remedy(self) -> str:
        if self.wait is None:
            return "it never cools so far: make a smaller jump"
        return f"wait {math.ceil(self.wait):d} s"


def rise_of(
    hardware: Hardware, motor: str, temperature: float, load: Mapping[str, float] | None
) -> float:
    """Return the temperature rise of a winding in the next jump [K].

    Args:
        temperature: of the winding [deg C].
        load: the integral of the squared torque of every motor over the plan [N^2 m^2 s]; none: no plan is known.
    """
    drives = hardware.drives
    if load is None:
        return drives.jump_heating
    resistance = drives.winding_resistance * (1.0 + COPPER * (temperature - _NOMINAL))
    energy = resistance / hardware.torque_constant_of(motor) ** 2 * load[motor]
    return drives.heat_margin * energy / drives.winding_heat_capacity


def cooling_time(hardware: Hardware, temperature: float, wanted: float) -> float | None:
    """Return the time in which a winding cools to a wanted temperature [s]; ``None`` if it never does."""
    drives = hardware.drives
    if temperature <= wanted:
        return 0.0
    if wanted <= drives.coolant_temperature:
        return None
    constant = drives.winding_thermal_resistance * drives.winding_heat_capacity
    start, end = temperature - drives.coolant_temperature, wanted - drives.coolant_temperature
    return constant * math.log(start / end)


def hot_winding(
    hardware: Hardware, motor: str, temperature: float, load: Mapping[str, float] | None
) -> HotWinding | None:
    """Return the winding of a motor if the next jump would overheat it; arguments as for ``rise_of``."""
    limit, rise = hardware.drives.highest_temperature, rise_of(hardware, motor, temperature, load)
    if temperature + rise <= limit:
        return None
    # Colder copper heats less: what it must cool to is a fixed point, found from above.
    wanted = limit - rise
    for _ in range(20):
        wanted = limit - rise_of(hardware, motor, wanted, load)
    wait = cooling_time(hardware, temperature, wanted)
    return HotWinding(motor, temperature, rise, limit, load is not None, wait)
