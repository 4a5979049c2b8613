"""The signal of counters and timers: a vector of one number."""

from __future__ import annotations

from ...runtime.language.signals import Field, Signal


class Number(Signal):
    """One number as a vector of one element, so that it fits blocks with n = 1."""

    value = Field(1, unit="", text="the number")


class Seconds(Signal):
    """A duration as a vector of one element, so that it fits blocks with n = 1."""

    value = Field(1, unit="s", text="the duration")


class Tally(Signal):
    """A whole number that is remembered."""

    count = Field((), dtype="int64", text="the number")
