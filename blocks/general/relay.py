"""A switch with hysteresis."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters, live_parameter
from .elements import Elements
from .flags import Flags
from .quantity_parameters import Says, SourceParameters
from .vector import Vector


class Relay(Says, Block):
    """Two values with hysteresis: on from u >= switch_on, off from u <= switch_off.

    In between every element stays as it was; all begin off. y = on_value or off_value.
    """

    class Params(Elements, SourceParameters):
        in_unit = (
            "on_value",
            "off_value",
        )

        switch_on: float = live_parameter(0.5, text="the input from which it is on")
        switch_off: float = live_parameter(-0.5, text="the input down to which it stays on")
        on_value: float = live_parameter(1.0, text="the output when on")
        off_value: float = live_parameter(0.0, text="the output when off")

    params: Params
    u = Input(Vector, text="what switches")
    y = Output(Vector, text="on_value or off_value")
    on = Output(Flags, text="which elements are on")
    x = State(Flags, text="which elements are on")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """It must switch off below where it switches on."""
        assert isinstance(params, cls.Params)
        if params.switch_off > params.switch_on:
            yield Misfit(
                "switch_off is above switch_on",
                parameter="switch_off",
                expected=f"at most {params.switch_on:g}",
                found=f"{params.switch_off:g}",
            )

    def setup(self) -> None:
        """Keep the thresholds at hand."""
        self._above = np.zeros(self.params.n, bool)
        self.on_parameters()

    def on_parameters(self) -> None:
        """As arrays, so that no tick makes them."""
        self._on, self._off = np.array(self.params.switch_on), np.array(self.params.switch_off)
        self._value = np.array(self.params.on_value)

    def step(self) -> None:
        """Switch what is beyond its threshold."""
        np.greater(self.u.value, self._off, out=self._above)
        np.logical_and(self.x.value, self._above, out=self.x.value)
        np.greater_equal(self.u.value, self._on, out=self._above)
        np.logical_or(self.x.value, self._above, out=self.x.value)
        np.copyto(self.on.value, self.x.value)
        self.y.value.fill(self.params.off_value)
        np.copyto(self.y.value, self._value, where=self.x.value)
