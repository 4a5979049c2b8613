"""Swings a pole up and balances it."""

import numpy as np
from balance import Balance

from aloft import parameter
from aloft.blocks.signals import CommandMode


class SwingUp(Balance):
    """The regulator of ``Balance`` near upright, else a force on the cart that adds energy::

        force = gain (E_up - E) q' cos(q) - centring (3 s + 2 s')

    with the pole's angle q and its energy E = q'^2 / 2 + w^2 cos(q), both per moment of inertia,
    w^2 = ``pull``, and the cart's place s. The joint ``slide`` is the cart's, ``hinge`` the pole's.
    """

    class Params(Balance.Params):
        gain: float = parameter(3.0, gt=0, text="force for energy [N s^3]")
        centring: float = parameter(1.5, ge=0, text="force back to the middle [N/m, N s/m]")
        pull: float = parameter(14.7, gt=0, text="m g l / J of the pole [1/s^2]")
        near: float = parameter(0.4, gt=0, text="the regulator's range [rad]")

    params: Params

    def step(self) -> None:
        """Make one tick."""
        place, angle = self.joints.position
        speed, turning = self.joints.velocity
        turned = (angle + np.pi) % (2 * np.pi) - np.pi
        command, p = self.command, self.params
        for field in (command.position, command.velocity, command.stiffness, command.damping):
            field.fill(0.0)
        command.torque.fill(0.0)
        if abs(turned) < p.near and abs(turning) < 4.0:
            state = (place, turned, speed, turning)
            command.torque[0] = -sum(self.gains[0, k] * x for k, x in enumerate(state))
        else:
            energy = 0.5 * turning**2 + p.pull * np.cos(turned)
            force = p.gain * (p.pull - energy) * turning * np.cos(turned)
            force = min(max(force, -8.0), 8.0)
            command.torque[0] = -force - p.centring * (3.0 * place + 2.0 * speed)
        command.mode[()] = CommandMode.ACTIVE
