"""Rotations: quaternions, matrices, Euler angles, and vectors that they turn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ...mathematics.kernel import kernel
from ...mathematics.rotations import (
    conjugate,
    from_euler,
    from_matrix,
    multiply,
    rotate,
    rotate_back,
    to_euler,
    to_matrix,
)
from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import InputQuantities, OutputQuantities, Quantity
from ...runtime.language.signals import Field, Signal


class Quaternion(Signal):
    """A rotation as a unit quaternion."""

    value = Field(
        4, unit="", quaternion=True, text="x, y, z, w (Hamilton); takes body vectors to the world"
    )


class RotationMatrix(Signal):
    """A rotation as a matrix."""

    value = Field((3, 3), unit="", text="the rotation matrix; takes body vectors to the world")


class EulerAngles(Signal):
    """A rotation as three angles."""

    value = Field(3, unit="rad", text="roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll)")


class Vector3(Signal):
    """A vector in space."""

    value = Field(3, inferred=True, text="x, y, z")


def random_unit(rng: np.random.Generator) -> Mapping[str, Any]:
    """Return a random unit quaternion, for the conformance suite."""
    value = rng.normal(size=4)
    return {"value": value / np.sqrt(np.sum(value * value))}


class QuaternionInput:
    """The base of blocks whose input ``u`` is a unit quaternion."""

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """Return a unit quaternion."""
        return {"u": random_unit(rng)}


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
        """Return a unit quaternion."""
        return {"rotation": random_unit(rng)}

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Check that the vector is in the first frame; the result is in the second."""
        assert isinstance(params, cls.Params)
        before, _, after = params.direction.split()
        u = inputs["u"]
        if u is None:
            return {}
        if u.elements:
            inputs.refuse("u", "a rotation mixes its elements")
            return {"y": Quantity(None, after)}
        inputs.agree("u", Quantity(u.unit, before), f"the block turns vectors from {before}")
        return {"y": Quantity(u.unit, after)}

    @kernel
    @staticmethod
    def step(rotation: Quaternion, u: Vector3, y: Vector3, params: Params) -> None:
        if params.direction == "body to world":
            rotate(rotation.value, u.value, y.value)
        else:
            rotate_back(rotation.value, u.value, y.value)


class QuaternionProduct(Block):
    """The product of two unit quaternions: y = a b, which turns first by b and then by a.

    With ``inverse`` it is y = a* b: the rotation b seen from a, so the error from a to b.
    """

    class Params(Parameters):
        inverse: bool = parameter(False, text="inverts a")

    class Scratch(Signal):
        """Scratch memory of one step."""

        inverse = Field(4, text="a*")

    params: Params
    a = Input(Quaternion, text="the second rotation")
    b = Input(Quaternion, text="the first rotation")
    y = Output(Quaternion, text="both")

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """Return unit quaternions."""
        return {"a": random_unit(rng), "b": random_unit(rng)}

    @kernel
    @staticmethod
    def step(a: Quaternion, b: Quaternion, y: Quaternion, params: Params, scratch: Scratch) -> None:
        if params.inverse:
            conjugate(a.value, scratch.inverse)
            multiply(scratch.inverse, b.value, y.value)
        else:
            multiply(a.value, b.value, y.value)


class QuaternionToMatrix(QuaternionInput, Block):
    """The rotation matrix (3, 3) of a unit quaternion; it takes body vectors to the world."""

    u = Input(Quaternion, text="the unit quaternion")
    y = Output(RotationMatrix, text="the same rotation")

    @kernel
    @staticmethod
    def step(u: Quaternion, y: RotationMatrix) -> None:
        to_matrix(u.value, y.value)


class MatrixToQuaternion(Block):
    """The unit quaternion of a rotation matrix, with w >= 0 where w is not tiny (Shepperd)."""

    u = Input(RotationMatrix, text="the rotation matrix")
    y = Output(Quaternion, text="the same rotation")

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """Return a rotation matrix."""
        matrix = np.zeros((3, 3))
        to_matrix(random_unit(rng)["value"], matrix)
        return {"u": {"value": matrix}}

    @kernel
    @staticmethod
    def step(u: RotationMatrix, y: Quaternion) -> None:
        from_matrix(u.value, y.value)


class QuaternionToEuler(QuaternionInput, Block):
    """Roll, pitch and yaw of a unit quaternion: R = Rz(yaw) Ry(pitch) Rx(roll).

    Roll and yaw jump where they pass pi, near a pitch of +-pi/2 they are ill-conditioned, and within 1e-8 rad of it
    roll is zero: use them to look at, and quaternions to control with.
    """

    u = Input(Quaternion, text="the unit quaternion")
    y = Output(EulerAngles, text="roll, pitch, yaw")

    @kernel
    @staticmethod
    def step(u: Quaternion, y: EulerAngles) -> None:
        to_euler(u.value, y.value)


class EulerToQuaternion(Block):
    """The unit quaternion of roll, pitch and yaw: R = Rz(yaw) Ry(pitch) Rx(roll)."""

    u = Input(EulerAngles, text="roll, pitch, yaw")
    y = Output(Quaternion, text="the same rotation")

    @kernel
    @staticmethod
    def step(u: EulerAngles, y: Quaternion) -> None:
        from_euler(u.value, y.value)
