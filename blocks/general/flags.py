"""The signals of the logic blocks, and of what a condition or a trigger switches."""

from __future__ import annotations

from ...runtime.language.signals import Field, Signal


class Flags(Signal):
    """A vector of ``n`` truth values."""

    value = Field("n", dtype="bool", text="the truth values")


class Flag(Signal):
    """One truth value."""

    value = Field((), dtype="bool", text="whether it holds")


NEVER = {"value": False}
"""The default of an optional trigger or condition that is not wired."""
