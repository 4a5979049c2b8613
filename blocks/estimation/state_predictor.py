"""Predicts the state over the delay, so that the controller works where its command takes effect."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import (
    Array0D,
    Array1D,
    Array2D,
    Flags1D,
    Indices0D,
    Vector3,
)
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...mathematics.rotations import cross, exponential, multiply, rotate, rotate_back
from ...runtime.language.block import Input, Output, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.signals import Field, Signal
from ..signals import BaseState, DelayEstimate, JointState, Phase, PhaseState, WholeBodyCommand

KEPT = 24
"""The number of commands that are remembered."""

_FLIGHT = int(Phase.FLIGHT)


class CommandMemory(Signal):
    """The state of ``StatePredictor``."""

    acceleration = Field((KEPT, "n_velocities"), text="of the last commands, newest first")
    loaded = Field(KEPT, dtype="bool", text="whether a point was in stance in these ticks")


class StatePredictor(KernelBlock):
    """The state when the command of this tick takes effect, by the commands that are on their way.

    The commands that are computed from t - d on act at t and later, d being the delay from sensing
    to torque. Each is the whole-body controller's and has its accelerations v', which are known. So
    the state at t + a, with a = ``delay.ahead`` <= d, follows from the measured one (the finite
    spectrum of Manitius and Olbrot 1979, a Smith predictor for the whole state)::

        v(t + a) = v(t) + sum_i w_i v'_i,    w_i the time within [t, t + a] in which command i acts
        q(t + a) = q(t) + a v(t) + sum_i w_i (a - m_i) v'_i,    m_i the middle of that time

    With an exact model the feedback loop then has the phase lag of the rest of the delay, d - a,
    alone, whatever d is.

    While no point was in stance the base falls freely, and joints, which their drives control
    without this delay, and the base keep their angular velocity. After touchdown nothing is assumed
    about the commands that were still made for flight: the impact is not known. Measurement noise
    of a velocity adds a times itself to a position. With ``ahead`` 0 the output is the input.
    """

    needs = ("floating base",)

    measured_base = Input(BaseState, text="pose and velocity of the base")
    measured_joints = Input(JointState, text="joint angles and velocities")
    command = Input(WholeBodyCommand, text="the last whole-body command")
    phase = Input(PhaseState, text="the phase and the points in stance of that command")
    delay = Input(DelayEstimate, text="the delay, and how far ahead to predict")
    base = Output(BaseState, text="the base when the command takes effect")
    joints = Output(JointState, text="the joints then; torques as measured")
    memory = State(CommandMemory, text="the commands on their way")

    def setup(self) -> None:
        n = len(self.robot.joints)
        predicting = KernelCall(
            predict_state, Sent(self.command.acceleration, self.phase.phase, self.phase.stance),
            self.delay.delay, self.delay.ahead, self.period,
            self.memory.acceleration, self.memory.loaded,
            *(
                Body(
                    base.position, base.orientation, base.linear_velocity, base.angular_velocity,
                    joints.position, joints.velocity, joints.torque,
                )
                for base, joints in (
                    (self.measured_base, self.measured_joints), (self.base, self.joints),
                )
            ),
            Change(np.zeros(6), np.zeros(6 + n), np.zeros(6 + n), np.zeros(3), np.zeros(3), np.zeros(4)),
        )  # fmt: skip
        self.kernel_calls = (predicting,)


class Sent(NamedTuple):
    """The last command: its ``acceleration`` (n_velocities,), ``phase`` () and ``stance`` (n_contacts,)."""

    acceleration: Array1D
    phase: Indices0D
    stance: Flags1D


class Body(NamedTuple):
    """The fields of ``BaseState``, then those of ``JointState``."""

    position: Vector3
    orientation: Array1D
    linear_velocity: Vector3
    angular_velocity: Vector3
    joint_position: Array1D
    joint_velocity: Array1D
    torque: Array1D


class Change(NamedTuple):
    """Memory: the base's acceleration in free fall (6,) and the changes of velocities and of places,
    (n_velocities,), vectors (3,) and a quaternion (4,)."""

    fall: Array1D
    speed: Array1D
    way: Array1D
    vector: Vector3
    spare: Vector3
    turn: Array1D


@kernel
def remember_command(sent: Sent, acceleration: Array2D, loaded: Flags1D) -> None:
    """Put the last command before the others."""
    for i in range(loaded.shape[0] - 1, 0, -1):
        loaded[i] = loaded[i - 1]
        acceleration[i, :] = acceleration[i - 1]
    loaded[0] = False
    for point in range(sent.stance.shape[0]):
        loaded[0] = loaded[0] or bool(sent.stance[point])
    acceleration[0, :] = sent.acceleration


@kernel
def free_fall(body: Body, change: Change) -> None:
    """The rate of the base's velocity in its own axes in free fall, without a change of its spin."""
    fall, vector, spare = change.fall, change.vector, change.spare
    vector[0], vector[1], vector[2] = 0.0, 0.0, -GRAVITY
    rotate_back(body.orientation, vector, fall[0:3])
    rotate_back(body.orientation, body.linear_velocity, vector)
    cross(body.angular_velocity, vector, spare)
    for k in range(3):
        fall[k] = fall[k] - spare[k]
        fall[3 + k] = 0.0


@kernel
def add_commands(
    flies: bool,
    delay: float,
    ahead: float,
    period: float,
    acceleration: Array2D,
    loaded: Flags1D,
    change: Change,
) -> None:
    """The changes of velocities and places within ``ahead`` by the commands that act then.

    The command that is i + 1 ticks old acts from delay - (i + 1) period on, for a period.
    """
    n = change.speed.shape[0]
    for k in range(n):
        change.speed[k] = 0.0
        change.way[k] = 0.0
    for i in range(loaded.shape[0]):
        begin = max(delay - (i + 1) * period, 0.0)
        end = ahead if i == 0 else min(delay - i * period, ahead)
        lasts = end - begin
        if lasts <= 0.0:
            continue
        weight = lasts * (ahead - 0.5 * (begin + end))
        if loaded[i]:
            for k in range(n):
                change.speed[k] = change.speed[k] + lasts * acceleration[i, k]
                change.way[k] = change.way[k] + weight * acceleration[i, k]
        elif flies:
            for k in range(3):
                change.speed[k] = change.speed[k] + lasts * change.fall[k]
                change.way[k] = change.way[k] + weight * change.fall[k]


@kernel
def predict_state(
    sent: Sent,
    delay: Array0D,
    ahead: Array0D,
    period: float,
    acceleration: Array2D,
    loaded: Flags1D,
    measured: Body,
    predicted: Body,
    change: Change,
) -> None:
    """One tick of ``StatePredictor``."""
    remember_command(sent, acceleration, loaded)
    time = ahead[()]
    flies = sent.phase[()] == _FLIGHT
    free_fall(measured, change)
    add_commands(flies, delay[()], time, period, acceleration, loaded, change)
    speed, way, vector, spare, turn = (
        change.speed, change.way, change.vector, change.spare, change.turn,
    )  # fmt: skip
    rotate_back(measured.orientation, measured.linear_velocity, vector)
    for k in range(3):
        speed[k] = vector[k] + speed[k]
        way[k] = way[k] + time * vector[k]
        way[3 + k] = way[3 + k] + time * measured.angular_velocity[k]
        predicted.angular_velocity[k] = measured.angular_velocity[k] + speed[3 + k]
    rotate(measured.orientation, way[0:3], spare)
    exponential(way[3:6], turn)
    multiply(measured.orientation, turn, predicted.orientation)
    rotate(predicted.orientation, speed[0:3], predicted.linear_velocity)
    predicted.position[:] = measured.position + spare
    for joint in range(predicted.joint_position.shape[0]):
        rate = measured.joint_velocity[joint]
        predicted.joint_velocity[joint] = rate + speed[6 + joint]
        place = measured.joint_position[joint] + time * rate
        predicted.joint_position[joint] = place + way[6 + joint]
        predicted.torque[joint] = measured.torque[joint]
