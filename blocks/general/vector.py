"""The signal of the general blocks: a vector of plain numbers."""

from __future__ import annotations

from ...runtime.language.signals import Field, Signal


class Vector(Signal):
    """A vector of ``n`` numbers. Its unit and frame are those of what is wired."""

    value = Field("n", carried=True, text="the vector's elements")
