"""The signal of the general blocks: a vector of plain numbers."""

from __future__ import annotations

from ...runtime.language.signals import Field, Signal


class Vector(Signal):
    """A vector of ``n`` numbers. It has no unit and no frame, so it fits any of them."""

    value = Field("n", text="the vector's elements")
