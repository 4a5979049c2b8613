"""What the error byte of an actuator's reply says."""

from __future__ import annotations

from dataclasses import dataclass

HEALTHY = 0x80
"""The error byte of an actuator that has nothing to report: bit 7 is always set."""


@dataclass(frozen=True)
class Condition:
    """One bit of the error byte.

    A warning passes by itself. With an error the actuator has switched its torque off.
    """

    bit: int
    critical: bool
    text: str


CONDITIONS = (
    Condition(0, False, "it received a damaged packet"),
    Condition(1, False, "its winding is hotter than temp_limit_low"),
    Condition(2, True, "it cannot read its absolute position"),
    Condition(3, True, "its watchdog ran out, or the emergency stop is pressed"),
    Condition(4, True, "it is outside its position limits"),
    Condition(5, True, "its supply voltage is out of range, or its gate driver failed"),
    Condition(6, True, "its flash memory is corrupt"),
)


def conditions(error_byte: int) -> tuple[Condition, ...]:
    """What an error byte reports; nothing where the actuator is healthy."""
    return tuple(c for c in CONDITIONS if error_byte & 1 << c.bit)


def is_critical(error_byte: int) -> bool:
    """Whether the actuator has switched its torque off, or its reply is no reply at all."""
    return not error_byte & HEALTHY or any(c.critical for c in conditions(error_byte))


def describe(error_byte: int) -> str:
    """The conditions in words; empty where the actuator is healthy."""
    if not error_byte & HEALTHY:
        return f"its error byte is {error_byte:#04x}, whose highest bit should be set"
    return "; ".join(c.text for c in conditions(error_byte))
