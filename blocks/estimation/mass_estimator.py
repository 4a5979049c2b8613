"""Estimates what the robot weighs, and where its torso's centre of mass is, while it stands."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...mathematics.constants import GRAVITY
from ...mathematics.mass_filter import (
    LegScratch,
    base_force_map,
    correct_row,
    fade,
    split_friction,
    torso_moment,
)
from ...robots.description import RobotDescription
from ...robots.limb import chain_to
from ...runtime.language.block import Block, Input, Metric, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, JointState, MassEstimate, Phase, PhaseState

Array = NDArray[np.float64]

SCALE, COM, TILT, FRICTION = 0, 1, 4, 6
"""Where the unknowns begin: the factor on all masses; the offset of the torso's CoM [m] (3); the
error of the estimated tilt [rad] (2); by joint its unknown friction, as a share of its friction."""


class MassMemory(Signal):
    """The state of ``MassEstimator``."""

    velocity = Field("n_velocities", text="generalised velocity, low-pass filtered")
    torque = Field("n_joints", unit="N m", text="measured torques, low-pass filtered")
    unknowns = Field("n_unknowns", text="the estimate of the unknowns")
    covariance = Field(("n_unknowns", "n_unknowns"), text="of its error")
    published = Field(4, text="factor on all masses and torso's CoM [m], as they are published")
    ticks = Field(dtype="int64", text="ticks so far while standing; none counts after the thrust")
    over = Field(dtype="bool", text="whether the robot has thrust, so that the estimate stays")


class MassEstimator(Block):
    """Mass and centre of mass from the torques that carry them, by a Kalman filter.

    While all loaded feet stand, the measured joint torques tau determine the forces on the feet,
    and these carry the weight: with the model's terms M, n at the present estimate and the map G
    from torques of the legs' joints to the generalised force on the base,

        (M_b a + n_b) - G (M_j a + n_j) + G (tau - c) = 0,

    six equations every ``interval`` (``mathematics/mass_filter``). Unknown are a factor s on all
    masses and inertias, the offset d of the torso's centre of mass, and the friction c. The
    acceleration a is the derivative of the generalised velocity, filtered as the torques are.

    **Friction** is what limits the accuracy: a joint at rest holds any torque up to its static
    friction. In a joint that moves it is known but for the share ``friction_left``, so the squat
    tells more than standing still. The unknown part of each joint is a process of the standard
    deviation ``friction_share`` times the joint's friction that is forgotten within
    ``friction_time``. An error ``tilt_std`` of the estimated tilt cannot be told from an offset, so
    it is an unknown too: the offset that is found then is the one for which the robot balances.
    The height of the torso's centre of mass is hardly observable while the torso is level.

    Before anything is measured the estimate is ``mass`` and ``com_offset``, by default the
    description's, with the standard deviations ``mass_spread`` and ``com_spread``. Equations further than ``gate`` standard deviations off,
    such as those during a push, are left out. The outputs follow the estimate with the time
    constant ``smoothing``, because controllers follow them. From the first thrust on the estimate
    stays.

    The block does not estimate single links' masses or inertias; all scale alike. Joints outside
    the legs carry no part of the weight to the ground, so their torques are not used. It is a Moore
    block: ``Dynamics`` reads its output, and its terms come back here.
    """

    class Params(Parameters):
        mass: float | None = parameter(
            None, unit="kg", gt=0.0, text="the robot's mass before; none: the description's"
        )
        com_offset: list[float] = parameter(
            [0.0, 0.0, 0.0], unit="m", min_length=3, max_length=3,
            text="offset of the torso's CoM before",
        )  # fmt: skip
        mass_spread: float = parameter(
            0.1, gt=0.0, le=1.0, text="standard deviation of the mass before, as a share"
        )
        com_spread: float = parameter(
            0.01, unit="m", gt=0.0, text="standard deviation of the torso's CoM before, per axis"
        )
        friction_share: float = parameter(
            0.65,
            ge=0.0,
            le=1.0,
            text="standard deviation of a resting joint's friction, as a share",
        )
        friction_left: float = parameter(
            0.5, ge=0.0, le=1.0, text="share of friction that stays unknown in a moving joint"
        )
        friction_speed: float = parameter(
            0.05, unit="rad/s", gt=0.0, text="speed above which a joint moves"
        )
        friction_time: float = parameter(
            0.3, unit="s", gt=0.0, text="correlation time of the unknown friction"
        )
        tilt_std: float = parameter(
            0.003, unit="rad", ge=0.0, text="standard deviation of the estimated tilt"
        )
        force_noise: float = parameter(
            0.08, gt=0.0, text="standard deviation of an equation's force, in weights of the robot"
        )
        moment_noise: float = parameter(
            0.003, unit="m", gt=0.0, text="the same of its moment, in weights of the robot"
        )
        gate: float = parameter(
            4.0, gt=0.0, text="standard deviations beyond which an equation is not used"
        )
        interval: float = parameter(0.01, unit="s", gt=0.0, text="time between two measurements")
        filter_time: float = parameter(
            0.006, unit="s", gt=0.0, text="time constant of the filters of velocity and torque"
        )
        settle_time: float = parameter(
            0.05, unit="s", ge=0.0, text="time before the first measurement"
        )
        smoothing: float = parameter(
            0.05, unit="s", ge=0.0, text="time constant with which the outputs follow the estimate"
        )

    needs = ("floating base", "feet")
    params: Params
    terms = Input(DynamicsTerms, text="the model's terms, at the published estimate")
    joints = Input(JointState, text="measured torques")
    phase = Input(PhaseState, text="the phase and the points that carry load")
    estimate = Output(MassEstimate, text="mass and torso's centre of mass, with uncertainty")
    memory = State(MassMemory, text="the filter")

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """The number of unknowns."""
        assert robot is not None
        return {"n_unknowns": FRICTION + len(robot.joints)}

    def setup(self) -> None:
        robot, p = self.robot, self.params
        n = len(robot.joints)
        legs = [chain_to(robot, foot.link) for foot in robot.feet]
        self._chains = np.full((len(legs), max(map(len, legs))), -1)
        for foot, leg in enumerate(legs):
            self._chains[foot, : len(leg)] = leg
        self._foot_of_point = np.array(robot.foot_of_contact())
        longest = self._chains.shape[1]
        self._leg = LegScratch(np.zeros((longest, longest)), np.zeros((longest, 6)))
        self._mass = robot.total_mass
        self._torso = next(link.mass for link in robot.links if link.name == robot.base)
        self._friction, self._damping = robot.motors.friction, robot.motors.damping
        self._every = max(1, round(p.interval / self.period))
        self._filter = min(1.0, self.period / p.filter_time)
        self._follow = min(1.0, self.period / p.smoothing) if p.smoothing else 1.0
        self._kept = math.exp(-self._every * self.period / p.friction_time)
        weight = self._mass * GRAVITY
        self._noise = [p.force_noise * weight] * 3 + [p.moment_noise * weight] * 3
        size = FRICTION + n
        self._map, self._rows = np.zeros((6, n)), np.zeros((6, size))
        self._acceleration, self._force = np.zeros(6 + n), np.zeros(6 + n)
        self._known, self._unknown, self._joint = np.zeros(n), np.zeros(n), np.zeros(n)
        self._base, self._residual = np.zeros(6), np.zeros(6)
        self._seen, self._product = np.zeros(size), np.zeros((size, size))
        self._expected = np.zeros(size)
        self._step, self._change = np.zeros(4), np.zeros(n)

    def start(self) -> None:
        """Begin with what was known before, and its uncertainty."""
        p, memory = self.params, self.memory
        deviations = np.empty(len(memory.unknowns))
        deviations[SCALE], deviations[COM:TILT] = p.mass_spread, p.com_spread
        deviations[TILT:FRICTION], deviations[FRICTION:] = p.tilt_std, p.friction_share
        memory.covariance[...] = np.diag(deviations**2)
        scale = 1.0 if p.mass is None else p.mass / self._mass
        memory.unknowns[SCALE] = memory.published[0] = scale
        memory.unknowns[COM:TILT] = memory.published[1:] = p.com_offset

    def emit(self) -> None:
        memory, out = self.memory, self.estimate
        out.mass[()] = self._mass * float(memory.published[0])
        out.mass_std[()] = self._mass * math.sqrt(memory.covariance.item(SCALE, SCALE))
        out.com_offset[...] = memory.published[1:]
        for k in range(3):
            out.com_offset_std[k] = math.sqrt(memory.covariance.item(COM + k, COM + k))

    def update(self) -> None:
        memory, phase = self.memory, int(self.phase.phase)
        if memory.ticks == 0:
            memory.velocity[...] = self.terms.velocity
            memory.torque[...] = self.joints.torque
        if phase > Phase.SQUAT:
            memory.over[()] = True
        if not memory.over:
            memory.ticks += 1
            np.subtract(self.terms.velocity, memory.velocity, out=self._acceleration)
            self._acceleration *= self._filter
            memory.velocity += self._acceleration
            self._acceleration /= self.period
            np.subtract(self.joints.torque, memory.torque, out=self._change)
            self._change *= self._filter
            memory.torque += self._change
            due = int(memory.ticks) % self._every == 0
            if due and int(memory.ticks) * self.period >= self.params.settle_time:
                self._measure()
        np.subtract(memory.unknowns[:4], memory.published, out=self._step)
        self._step *= self._follow
        memory.published += self._step

    def _measure(self) -> None:
        """Correct the estimate by the equations of this instant."""
        p, memory = self.params, self.memory
        if not self.phase.stance.any():
            return
        fade(memory.unknowns, memory.covariance, FRICTION, self._kept, p.friction_share**2)
        self._form_rows()
        for k in range(6):
            self._expected[...] = memory.unknowns
            self._expected[:TILT] -= memory.published
            self._expected *= self._rows[k]
            error = -float(self._residual[k]) - float(self._expected.sum())
            correct_row(
                memory.unknowns, memory.covariance, self._rows[k], error, self._noise[k], p.gate,
                self._seen, self._product,
            )  # fmt: skip

    def _form_rows(self) -> None:
        """The equations' residual at the published estimate without the unknown parts of tilt and
        friction, and its derivative by the unknowns."""
        p, terms, memory, rows, force = (
            self.params,
            self.terms,
            self.memory,
            self._rows,
            self._force,
        )
        base_force_map(
            terms.contact_jacobian, self.phase.stance, self._foot_of_point, self._chains,
            self._leg, self._map,
        )  # fmt: skip
        split_friction(
            memory.velocity[6:], self._friction, self._damping, p.friction_speed, p.friction_left,
            self._known, self._unknown,
        )  # fmt: skip
        np.dot(terms.mass_matrix, self._acceleration, out=force)
        force += terms.nonlinear_effects
        np.subtract(memory.torque, self._known, out=self._joint)
        self._joint -= force[6:]
        np.dot(self._map, self._joint, out=self._residual)
        self._residual += force[:6]
        # The derivatives are those at rest: noise of the acceleration in them would bias the result.
        scale = float(memory.published[0])
        np.dot(self._map, terms.nonlinear_effects[6:], out=self._base)
        np.subtract(terms.nonlinear_effects[:6], self._base, out=self._base)
        np.divide(self._base, scale, out=rows[:, SCALE])
        torso_moment(terms.base_rotation, scale * self._torso * GRAVITY, rows[3:, COM:TILT])
        lever = float(terms.com[2]) - float(terms.foot_position[:, 2].min())
        rows[3, TILT] = rows[4, TILT + 1] = scale * self._mass * GRAVITY * lever
        np.multiply(self._unknown, self._friction, out=self._joint)
        np.multiply(self._map, self._joint, out=rows[:, FRICTION:])
        np.negative(rows[:, FRICTION:], out=rows[:, FRICTION:])

    def metrics(self) -> Mapping[str, Metric]:
        """The estimate at the end."""
        memory = self.memory
        x, y, z = (1e3 * value for value in memory.unknowns[COM:TILT].tolist())
        return {
            "felt_mass_kg": self._mass * memory.unknowns.item(SCALE),
            "felt_mass_std_kg": self._mass * math.sqrt(memory.covariance.item(SCALE, SCALE)),
            "felt_com_offset_x_mm": x,
            "felt_com_offset_y_mm": y,
            "felt_com_offset_z_mm": z,
        }
