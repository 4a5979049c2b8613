"""A vector seen from another frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ...mathematics.rotations import rotate, rotate_back
from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import Carried, Given, Quantity
from .rotation_signals import Quaternion, Vector3, random_unit


class RotateVector(Block):
    """A vector turned by a unit quaternion q, from body to world, or back: y = q u q*, or q* u q."""

    class Params(Parameters):
        direction: Literal["body to world", "world to body"] = parameter(
            "body to world", text="from which frame to which"
        )

    params: Params
    rotation = Input(Quaternion, text="q, the body's orientation in the world")
    u = Input(Vector3, text="the vector in the frame it comes from")
    y = Output(Vector3, text="the vector in the other frame")

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """A unit quaternion."""
        return {"rotation": random_unit(rng)}

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """The vector must be in the first frame; the result is in the second."""
        assert isinstance(params, cls.Params)
        before, _, after = params.direction.split()
        u = given["u"]
        if u is None:
            return {}
        given.agree("u", Quantity(u.unit, before), f"the block turns vectors from {before}")
        return {"y": Quantity(u.unit, after)}

    def setup(self) -> None:
        """Choose the direction."""
        self._turn = rotate if self.params.direction == "body to world" else rotate_back

    def step(self) -> None:
        """Turn."""
        self._turn(self.rotation.value, self.u.value, self.y.value)
