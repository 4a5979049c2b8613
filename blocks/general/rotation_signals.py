"""The signals of the blocks that turn vectors and convert rotations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...runtime.language.signals import Field, Signal


class Quaternion(Signal):
    """A rotation as a unit quaternion."""

    value = Field(4, unit="", text="x, y, z, w (Hamilton); takes body vectors to the world")


class RotationMatrix(Signal):
    """A rotation as a matrix."""

    value = Field((3, 3), unit="", text="the rotation matrix; takes body vectors to the world")


class EulerAngles(Signal):
    """A rotation as three angles."""

    value = Field(3, unit="rad", text="roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll)")


class Vector3(Signal):
    """A vector in space."""

    value = Field(3, carried=True, text="x, y, z")


def random_unit(rng: np.random.Generator) -> Mapping[str, Any]:
    """A random unit quaternion, for the conformance suite."""
    value = rng.normal(size=4)
    return {"value": value / np.sqrt(np.sum(value * value))}


class OfQuaternion:
    """The base of blocks whose input ``u`` is a unit quaternion."""

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """A unit quaternion."""
        return {"u": random_unit(rng)}
