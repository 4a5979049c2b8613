"""Inertial properties of rigid bodies: changes of frame, and several bodies joined into one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...mathematics.arrays import Array


@dataclass(frozen=True)
class Inertial:
    """``mass`` [kg], ``com`` [m] (3,) and ``inertia`` about the CoM [kg m^2] (3, 3) in a frame."""

    mass: float
    com: Array
    inertia: Array

    def moved(self, rotation: Array, position: Array) -> Inertial:
        """The body in another frame, in which its own frame has this rotation and position."""
        if np.array_equal(rotation, np.eye(3)):
            return Inertial(self.mass, self.com + position, self.inertia)
        inertia = rotation @ self.inertia @ rotation.T
        return Inertial(self.mass, rotation @ self.com + position, 0.5 * (inertia + inertia.T))

    def scaled(self, share: float) -> Inertial:
        """A body of the same distribution with a ``share`` of the mass."""
        return Inertial(self.mass * share, self.com, self.inertia * share)


NOTHING = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))


def joined(bodies: list[Inertial]) -> Inertial:
    """One body that is made of several bodies, all given in the same frame."""
    bodies = [body for body in bodies if body.mass > 0.0 or np.any(body.inertia)]
    if len(bodies) <= 1:
        return bodies[0] if bodies else NOTHING
    mass = sum(body.mass for body in bodies)
    if mass <= 0.0:
        return Inertial(mass, bodies[0].com, np.sum([body.inertia for body in bodies], axis=0))
    com = np.sum([body.mass * body.com for body in bodies], axis=0) / mass
    inertia = np.zeros((3, 3))
    for body in bodies:
        arm = body.com - com
        inertia += body.inertia + body.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return Inertial(mass, com, inertia)


def full_tensor(values: Array) -> Array:
    """The tensor (3, 3) of xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
