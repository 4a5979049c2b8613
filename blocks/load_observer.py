"""How heavy the robot really is and where its weight acts, from what its feet had to do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..runtime.block import Block, Input, Output, State
from ..runtime.errors import BlockError
from ..runtime.kernel import kernel
from ..runtime.parameters import Parameters, live_parameter, parameter
from ..runtime.signals import Field, Signal
from .signals import DynamicsTerms, Phase, PhaseState, WholeBodyCommand, WholeBodyTarget

Array = NDArray[np.float64]
_GRAVITY = 9.81


class ObservedLoad(Signal):
    """What the observer has found so far."""

    mass_ratio = Field(unit="", text="the robot's mass by the model's")
    offset = Field(2, unit="m", frame="world", text="its centre of mass from the model's, x and y")
    velocity = Field(unit="m/s", text="vertical velocity of the centre of mass at the last tick")
    momentum = Field(2, unit="N m s", frame="world", text="k about x and y at the last tick")
    started = Field(dtype="bool", text="whether these are known")


class LoadObserver(Block):
    """Corrects the target of the whole-body controller for a load that its model does not know.

    While the robot stands and squats, the forces that the controller commanded are compared with
    what the momentum did. With F = sum f the commanded force, c the model's centre of mass, m its
    mass and r = (m' / m, d) what is sought,

        m' (z'' + g) = F_z,                                   m' / m  = F_z / (m (z'' + g))
        k' = sum (p_i - c - d) x f_i,                         d_x =  (k' - k'_c)_y / F_z
                                                              d_y = -(k' - k'_c)_x / F_z

    with k'_c = sum (p_i - c) x f_i. Both go through a low pass of ``time_constant``. From the
    thrust on they are held. Until touchdown, what is fed forward is that of the real load,

        a_z -> m'/m (a_z + g) - g,        k' -> k' - (d_x, d_y) turned by 90 degrees times F_z,

    where F_z = m' (a_z + g); feedback then has little left to do. The model's mass must be wrong by
    less than ``largest_ratio`` and its centre by less than ``largest_offset``: the rest is cut off.

    A load that moves with the torso, sensor errors that look like one (a tilted inertial unit, an
    encoder's offset) and joint friction are all seen as one load at the feet's present posture.
    Does not change the model itself, and nothing after touchdown.
    """

    class Params(Parameters):
        time_constant: float = parameter(
            0.1, unit="s", gt=0.0, le=5.0, text="of the low pass on what is observed"
        )
        largest_ratio: float = parameter(
            0.15, ge=0.0, le=0.5, text="most by which the mass may differ from the model's"
        )
        largest_offset: float = parameter(
            0.015, unit="m", ge=0.0, le=0.1, text="the same of the centre of mass, along x and y"
        )
        share: float = live_parameter(
            1.0, ge=0.0, le=1.0, text="share of the observed load that is made up for"
        )

    params: Params
    desired = Input(WholeBodyTarget, text="the target for the model")
    terms = Input(DynamicsTerms, text="the present state")
    wbc = Input(WholeBodyCommand, text="the forces commanded at the last tick")
    phase = Input(PhaseState, text="the phase the robot is in")
    target = Output(WholeBodyTarget, text="the target for the real load")
    load = State(ObservedLoad, text="what was observed so far")

    def setup(self) -> None:
        robot = self.context.robot
        if robot is None:
            raise BlockError("LoadObserver needs a robot: name one in the graph, e.g. robot: bruce")
        self._mass = robot.total_mass
        self._fields = list(WholeBodyTarget.fields)
        self._moment = np.zeros(2)

    def start(self) -> None:
        self.load.mass_ratio[()] = 1.0

    def step(self) -> None:
        load, terms, p = self.load, self.terms, self.params
        for name in self._fields:
            getattr(self.target, name)[...] = getattr(self.desired, name)
        phase = int(self.phase.phase)
        vertical = sum_vertical(self.wbc.force)
        if phase <= Phase.SQUAT and load.started and vertical > 0.3 * self._mass * _GRAVITY:
            lift = (float(terms.com_velocity[2]) - float(load.velocity)) / self.period + _GRAVITY
            moment_about(terms.contact_position, terms.com, self.wbc.force, self._moment)
            share = min(self.period / p.time_constant, 1.0)
            ratio = vertical / (self._mass * max(lift, 0.3 * _GRAVITY))
            load.mass_ratio[()] = follow(
                float(load.mass_ratio), ratio, share, 1.0 - p.largest_ratio, 1.0 + p.largest_ratio
            )
            missed_x = (float(terms.angular_momentum[0]) - float(load.momentum[0])) / self.period
            missed_y = (float(terms.angular_momentum[1]) - float(load.momentum[1])) / self.period
            far = p.largest_offset
            load.offset[0] = follow(
                float(load.offset[0]), (missed_y - float(self._moment[1])) / vertical, share,
                -far, far,
            )  # fmt: skip
            load.offset[1] = follow(
                float(load.offset[1]), -(missed_x - float(self._moment[0])) / vertical, share,
                -far, far,
            )  # fmt: skip
        load.velocity[()] = terms.com_velocity[2]
        load.momentum[...] = terms.angular_momentum[:2]
        load.started[()] = True
        if phase <= Phase.THRUST:
            self._correct()

    def _correct(self) -> None:
        target, load, share = self.target, self.load, self.params.share
        ratio = 1.0 + share * (float(load.mass_ratio) - 1.0)
        lift = ratio * (float(target.com_acceleration[2]) + _GRAVITY)
        target.com_acceleration[2] = lift - _GRAVITY
        force = share * self._mass * max(lift, 0.0)
        target.angular_momentum_rate[0] += force * float(load.offset[1])
        target.angular_momentum_rate[1] -= force * float(load.offset[0])


@kernel
def sum_vertical(forces: Array) -> float:
    """The vertical sum of forces (n, 3)."""
    total = 0.0
    for i in range(forces.shape[0]):
        total += float(forces[i, 2])
    return total


@kernel
def moment_about(points: Array, centre: Array, forces: Array, out: Array) -> None:
    """The moment of forces (n, 3) at points (n, 3) about a centre (3,), about x and y."""
    out[:] = 0.0
    for i in range(points.shape[0]):
        x, y = float(points[i, 0] - centre[0]), float(points[i, 1] - centre[1])
        z = float(points[i, 2] - centre[2])
        out[0] += y * float(forces[i, 2]) - z * float(forces[i, 1])
        out[1] += z * float(forces[i, 0]) - x * float(forces[i, 2])


@kernel
def follow(value: float, goal: float, share: float, low: float, high: float) -> float:
    """A step of a low pass, kept between two bounds."""
    return min(max(value + share * (goal - value), low), high)
