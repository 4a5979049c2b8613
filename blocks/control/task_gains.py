"""Weights and gains of the whole-body controller's tasks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...runtime.language.parameters import Parameters, parameter

Array = NDArray[np.float64]
Vector = tuple[float, float, float]


class TaskGains(Parameters):
    """Weights and gains of the tasks in one kind of phase. Vectors are x, y, z: the world's for
    momentum, the body's for the torso."""

    stance_weight: float = parameter(1e3, ge=0.0, text="rest of the points in stance, per m/s^2")
    stance_damping: float = parameter(0.0, unit="1/s", ge=0.0, text="damps what they move")
    swing_weight: float = parameter(
        10.0,
        ge=0.0,
        text="unloaded points to the ground, per m/s^2; in the thrust they are damped across the foot",
    )
    swing_stiffness: float = parameter(3000.0, unit="1/s^2", ge=0.0, text="of that")
    swing_damping: float = parameter(110.0, unit="1/s", ge=0.0, text="of that")
    rolling_weight: float = parameter(
        0.1, ge=0.0, text="ankle of a foot that rolls over its toes, per rad/s^2"
    )
    rolling_stiffness: float = parameter(1000.0, unit="1/s^2", ge=0.0, text="of that")
    rolling_damping: float = parameter(60.0, unit="1/s", ge=0.0, text="of that")
    linear_weight: Vector = parameter((100.0, 100.0, 100.0), text="centre of mass, per m/s^2")
    linear_stiffness: Vector = parameter((100.0, 100.0, 100.0), unit="1/s^2", text="K_p of it")
    linear_damping: Vector = parameter((20.0, 20.0, 20.0), unit="1/s", text="K_d of it")
    torso_weight: Vector = parameter((10.0, 10.0, 10.0), text="torso, per rad/s^2")
    torso_stiffness: Vector = parameter((200.0, 200.0, 200.0), unit="1/s^2", text="K_p of it")
    torso_damping: Vector = parameter((28.0, 28.0, 28.0), unit="1/s", text="K_d of it")
    angular_weight: Vector = parameter((1.0, 1.0, 1.0), text="angular momentum, per N m")
    angular_damping: Vector = parameter((5.0, 5.0, 5.0), unit="1/s", text="K_d of it")
    track_angular_momentum: bool = parameter(
        False, text="track the target's angular momentum instead of damping all of it"
    )


@dataclass(frozen=True)
class GainArrays:
    """One set of gains as arrays."""

    source: TaskGains
    weights: Array
    linear_stiffness: Array
    linear_damping: Array
    torso_stiffness: Array
    torso_damping: Array
    angular_damping: Array

    @classmethod
    def of(cls, source: TaskGains) -> GainArrays:
        weights = [*source.linear_weight, *source.torso_weight, *source.angular_weight]
        return cls(
            source, np.array(weights),
            np.array(source.linear_stiffness), np.array(source.linear_damping),
            np.array(source.torso_stiffness), np.array(source.torso_damping),
            np.array(source.angular_damping),
        )  # fmt: skip
