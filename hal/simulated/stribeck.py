"""Friction of a simulated robot's joints that is larger at rest than in motion (Stribeck).

The simulator keeps a joint still as long as less than its friction loss acts on it, and takes that much
torque from one that moves. In every physics step the loss of a joint at speed ``v`` becomes

    F(v) = F_c (1 + (s - 1) exp(-(v / v_s)^2))

with the Coulomb friction ``F_c``, the static friction ``s F_c``, and the Stribeck velocity ``v_s`` (Armstrong-Helouvry,
Dupont, Canudas de Wit, Automatica 30, 1994, eq. 4, without its viscous part, which is the joint's damping). Where it falls
with speed it drives the joint; a step must be short beside the time in which that grows (``longest_stribeck_step``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Array1D
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.elementary import exp
from ...mathematics.kernel import kernel
from ...runtime.language.steps import signal_call
from .effect import Effect, StepViews


class StribeckFriction(NamedTuple):
    """Of all joints, (n_joints,): ``coulomb`` friction [N m], static friction ``beyond`` that [N m]; the
    Stribeck ``velocity`` [rad/s]."""

    coulomb: Array1D
    beyond: Array1D
    velocity: float


@kernel
def set_friction(velocity: Array1D, friction: StribeckFriction, loss: Array1D) -> None:
    """Write the friction loss [N m] of joints at their ``velocity`` [rad/s] to ``loss``, (n_joints,)."""
    for k in range(velocity.shape[0]):
        ratio = velocity[k] / friction.velocity
        loss[k] = friction.coulomb[k] + friction.beyond[k] * exp(-ratio * ratio)


def friction_call(
    velocity: Array, loss: Array, static: tuple[float, ...], stribeck_velocity: float
) -> KernelCall:
    """Return the call that brings the friction losses up to date before a physics step.

    Args:
        velocity: of the joints [rad/s], (n_joints,), a view of the simulator's memory.
        loss: their friction losses [N m], (n_joints,), a view of the simulator's model, with the Coulomb
            friction in it.
        static: the static friction of each joint as a multiple of that.
        stribeck_velocity: [rad/s].
    """
    coulomb = np.array(loss)
    friction = StribeckFriction(coulomb, coulomb * (np.array(static) - 1.0), stribeck_velocity)
    return signal_call(set_friction, velocity, friction, loss)


class FallingFriction(Effect):
    """Static friction of a simulated robot's joints; arguments as for ``friction_call``."""

    def __init__(self, loss: Array, static: tuple[float, ...], stribeck_velocity: float) -> None:
        self._given = loss, static, stribeck_velocity

    def model_calls(self, views: StepViews) -> list[Call]:
        """Bring the friction losses up to date."""
        return [friction_call(views.velocity, *self._given)]
