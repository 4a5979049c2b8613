"""Estimates what the robot weighs, and where its torso's centre of mass is, while it stands.

With base rows b and joint rows j of the equations of motion, and the forces f of the feet,

    M_b a + n_b = J_b' f,        M_j a + n_j = tau - c + J_j' f,

where c is the joints' friction. If the torques of the legs' joints determine the wrench of each
foot, f can be eliminated by the map G = J_b' (J_j')^+ from joint torques to forces on the base:

    (M_b a + n_b) - G (M_j a + n_j) + G (tau - c) = 0,

six equations that are linear in the masses. A Kalman filter solves them for the unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ...mathematics.arrays import Array1D, Indices1D
from ...mathematics.constants import GRAVITY
from ...mathematics.elementary import exp, tanh
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import multiply_vector, solve_rows
from ...mathematics.rotations import skew
from ...robots.description import RobotDescription
from ...robots.limb import leg_joints
from ...runtime.language.block import Block, Input, Metric, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.per_joint import PerJoint
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, JointState, MassEstimate, Phase, PhaseState

SCALE, COM, TILT, FRICTION = 0, 1, 4, 6
"""Offsets of the unknowns: the factor on all masses; the offset of the torso's CoM [m] (3); the error of the estimated
tilt [rad] (2); by joint its unknown friction, as a share of its friction."""
_DAMPING = 1e-8
"""Added to the squared lever arms [m^2] of the joints, so that a straight leg has a finite inverse."""


class MassMemory(Signal):
    """The state of ``MassEstimator``."""

    velocity = Field("n_velocities", text="generalised velocity, low-pass filtered")
    torque = Field("n_joints", unit="N m", text="measured torques, low-pass filtered")
    unknowns = Field("n_unknowns", text="the estimate of the unknowns")
    covariance = Field(("n_unknowns", "n_unknowns"), text="of its error")
    published = Field(4, text="factor on all masses and torso's CoM [m], as they are published")
    ticks = Field(dtype="int64", text="ticks so far while standing; none counts after the thrust")
    over = Field(dtype="bool", text="the robot has thrust, so that the estimate stays")


class MassParameters(Parameters):
    """The parameters of ``MassEstimator``."""

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
    friction: PerJoint = parameter(
        PerJoint(0.0), unit="N m", text="known joint friction beyond the description's"
    )
    damping: PerJoint = parameter(
        PerJoint(0.0), unit="N m s/rad", text="known joint damping, likewise"
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
    gyro_noise: float = parameter(
        0.02, unit="rad/s", ge=0.0,
        text="standard deviation of the gyroscope's noise; 0: ``moment_noise`` covers its effect",
    )  # fmt: skip
    gate: float = parameter(
        4.0, gt=0.0, text="standard deviations beyond which an equation is not used"
    )
    interval: float = parameter(0.01, unit="s", gt=0.0, text="time between two measurements")
    filter_time: float = parameter(
        0.006, unit="s", gt=0.0, text="time constant of the filters of velocity and torque"
    )
    settle_time: float = parameter(0.05, unit="s", ge=0.0, text="time before the first measurement")
    smoothing: float = parameter(
        0.05, unit="s", ge=0.0, text="time constant with which the outputs follow the estimate"
    )


class MassConstants(Signal):
    """Constants of the robot's description and the parameters."""

    mass = Field(unit="kg", text="of the robot")
    torso_mass = Field(unit="kg", text="of the torso")
    friction = Field("n_joints", unit="N m", text="friction of the joints")
    damping = Field("n_joints", unit="N m s/rad", text="their damping")
    foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")
    leg_joints = Field(
        ("n_feet", "n_leg_joints"), dtype="int64", text="joints of each foot's leg, then -1"
    )
    interval = Field(dtype="int64", text="ticks between two corrections")
    settling = Field(dtype="int64", text="ticks before the first one")
    filtering = Field(unit="", text="share of a change that the filters take over in a tick")
    following = Field(unit="", text="share of a change that the outputs take over in a tick")
    persistence = Field(unit="", text="correlation of the unknown friction over an interval")
    noise = Field(6, text="standard deviations of the equations [N, N m]")
    rotation_noise = Field(unit="rad/s^2", text="of the base's filtered angular acceleration")


class MassScratch(Signal):
    """Intermediate values of a tick of ``MassEstimator``."""

    acceleration = Field("n_velocities", text="derivative of the filtered velocity")
    force = Field("n_velocities", text="generalised force that the acceleration and gravity need")
    friction = Field("n_joints", unit="N m", text="known friction")
    unknown_friction = Field("n_joints", unit="N m", text="friction that stays unknown")
    torque = Field("n_joints", unit="N m", text="torque that is left for the ground")
    normal = Field(("n_leg_joints", "n_leg_joints"), text="J_j J_j' of a leg, damped")
    coupling = Field((6, "n_leg_joints"), text="J_b' J_j of a leg")
    force_map = Field((6, "n_joints"), text="G")
    rows = Field((6, "n_unknowns"), text="derivative of the equations by the unknowns")
    residual = Field(6, text="of the equations [N, N m]")
    difference = Field("n_unknowns", text="unknowns minus those that are published")
    gain = Field("n_unknowns", text="covariance of the unknowns with one equation")
    weight = Field(3, unit="N", text="of the torso, downwards, in axes of the base")


class MassEstimator(Block):
    """Mass and centre of mass from the torques that carry them, by a Kalman filter.

    While all loaded feet stand, the measured joint torques tau determine the forces on the feet,
    and these carry the weight: with the model's terms M, n at the present estimate and the map G
    from torques of the legs' joints to the generalised force on the base,

        (M_b a + n_b) - G (M_j a + n_j) + G (tau - c) = 0,

    six equations every ``interval``. Unknown are a factor s on all masses and inertias, the offset
    d of the torso's centre of mass, and the friction c. The acceleration a is the derivative of the
    generalised velocity, filtered as the torques are.

    Friction limits the accuracy (``docs/estimation.md``): what a robot has more of than its description
    belongs to ``friction`` and ``damping``, or it is taken for a torso whose mass is elsewhere. The unknown part of each joint is a process of
    the standard deviation ``friction_share`` times the joint's friction that is forgotten within
    ``friction_time``; in a joint that moves only the share ``friction_left`` of it is left. An error
    ``tilt_std`` of the estimated tilt cannot be told from an offset, so it is an unknown too: the
    offset that is found is the one for which the robot balances.

    Before anything is measured the estimate is ``mass`` and ``com_offset``, by default the
    description's, with the standard deviations ``mass_spread`` and ``com_spread``. Equations further
    than ``gate`` standard deviations off, such as those during a push, are left out. The outputs
    follow the estimate with the time constant ``smoothing``, because controllers follow them. From
    the first thrust on the estimate stays.

    The block does not estimate single links' masses or inertias; all scale alike. Joints outside
    the legs carry no part of the weight to the ground, so their torques are not used. It is a Moore
    block: ``Dynamics`` reads its output, and its terms come back here.
    """

    Params = MassParameters
    Constants = MassConstants
    Scratch = MassScratch
    needs = ("floating base", "feet")
    params: MassParameters
    constants: MassConstants
    terms = Input(DynamicsTerms, text="the model's terms, at the published estimate")
    joints = Input(JointState, text="measured torques")
    phase = Input(PhaseState, text="the phase and the points that carry load")
    estimate = Output(MassEstimate, text="mass and torso's centre of mass, with uncertainty")
    memory = State(MassMemory, text="the filter")

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Return the number of unknowns, and of the joints of the longest leg."""
        assert robot is not None
        longest = leg_joints(robot).shape[1]
        return {"n_unknowns": FRICTION + len(robot.joints), "n_leg_joints": longest}

    def setup(self) -> None:
        robot, constants = self.robot, self.constants
        constants.mass = robot.total_mass
        constants.torso_mass = next(x.mass for x in robot.links if x.name == robot.base)
        constants.friction[:] = robot.motors.friction + self.params.friction.resolve(robot)
        constants.damping[:] = robot.motors.damping + self.params.damping.resolve(robot)
        constants.foot_of_point[:] = robot.foot_of_contact()
        constants.leg_joints[:] = leg_joints(robot)

    def prepare(self) -> None:
        p, constants, period = self.params, self.constants, self.period
        weight = self.robot.weight
        interval = max(1, round(p.interval / period))
        share = min(1.0, period / p.filter_time)
        constants.interval = interval
        constants.settling = math.ceil(p.settle_time / period - 1e-9)
        constants.filtering = share
        constants.following = min(1.0, period / p.smoothing) if p.smoothing else 1.0
        constants.persistence = exp(-interval * period / p.friction_time)
        constants.noise[:3] = p.force_noise * weight
        constants.noise[3:] = p.moment_noise * weight
        # of the derivative of white noise behind a low-pass filter of the first order
        constants.rotation_noise = p.gyro_noise * share / period * math.sqrt(2.0 / (2.0 - share))

    def start(self) -> None:
        """Begin with what was known before, and its uncertainty."""
        p, memory = self.params, self.memory
        deviations = np.empty(len(memory.unknowns))
        deviations[SCALE], deviations[COM:TILT] = p.mass_spread, p.com_spread
        deviations[TILT:FRICTION], deviations[FRICTION:] = p.tilt_std, p.friction_share
        memory.covariance[...] = np.diag(deviations**2)
        scale = 1.0 if p.mass is None else p.mass / self.robot.total_mass
        memory.unknowns[SCALE] = memory.published[0] = scale
        memory.unknowns[COM:TILT] = memory.published[1:] = p.com_offset

    @kernel
    @staticmethod
    def emit(memory: MassMemory, estimate: MassEstimate, constants: MassConstants) -> None:
        # Rounding may leave a variance that is all but zero just below it.
        variance = memory.covariance[SCALE, SCALE]
        estimate.mass = constants.mass * memory.published[0]
        estimate.mass_std = constants.mass * math.sqrt(max(variance, 0.0))
        estimate.com_offset[:] = memory.published[1:]
        for k in range(3):
            variance = memory.covariance[COM + k, COM + k]
            estimate.com_offset_std[k] = math.sqrt(max(variance, 0.0))

    @kernel
    @staticmethod
    def update(
        terms: DynamicsTerms,
        joints: JointState,
        phase: PhaseState,
        memory: MassMemory,
        params: MassParameters,
        constants: MassConstants,
        scratch: MassScratch,
        period: float,
    ) -> None:
        if memory.ticks == 0:
            memory.velocity[:] = terms.velocity
            memory.torque[:] = joints.torque
        if phase.phase > Phase.SQUAT:
            memory.over = True
        if not memory.over:
            memory.ticks += 1
            scratch.acceleration[:] = (terms.velocity - memory.velocity) * constants.filtering
            memory.velocity[:] += scratch.acceleration
            scratch.acceleration[:] /= period
            memory.torque[:] += (joints.torque - memory.torque) * constants.filtering
            due = memory.ticks % constants.interval == 0 and memory.ticks >= constants.settling
            if due and any_stance(phase):
                forget_friction(memory, params, constants)
                form_equations(terms, phase, memory, params, constants, scratch)
                for k in range(6):
                    correct_by_equation(k, terms, memory, params, constants, scratch)
        memory.published[:] += (memory.unknowns[:4] - memory.published) * constants.following

    def metrics(self) -> Mapping[str, Metric]:
        """Return the estimate at the end."""
        memory = self.memory
        x, y, z = (1e3 * value for value in memory.unknowns[COM:TILT].tolist())
        return {
            "felt_mass_kg": self.robot.total_mass * memory.unknowns.item(SCALE),
            "felt_mass_std_kg": self.robot.total_mass
            * math.sqrt(memory.covariance.item(SCALE, SCALE)),
            "felt_com_offset_x_mm": x,
            "felt_com_offset_y_mm": y,
            "felt_com_offset_z_mm": z,
        }


@kernel
def any_stance(phase: PhaseState) -> bool:
    """Check whether any point carries load."""
    loaded = False
    for point in range(phase.stance.shape[0]):
        loaded = loaded or bool(phase.stance[point])
    return loaded


@kernel
def forget_friction(memory: MassMemory, params: MassParameters, constants: MassConstants) -> None:
    """One interval of the processes that the joints' unknown friction follows."""
    unknowns, covariance, factor = memory.unknowns, memory.covariance, constants.persistence
    variance = params.friction_share * params.friction_share
    for i in range(FRICTION, unknowns.shape[0]):
        unknowns[i] *= factor
        covariance[i, :] *= factor
        covariance[:, i] *= factor
        covariance[i, i] += (1.0 - factor * factor) * variance


@kernel
def form_equations(
    terms: DynamicsTerms,
    phase: PhaseState,
    memory: MassMemory,
    params: MassParameters,
    constants: MassConstants,
    scratch: MassScratch,
) -> None:
    """Form the equations' residual at the published estimate without the unknown parts of tilt and friction, and its
    derivative by the unknowns.

    The derivatives are those at rest: noise of the acceleration in them would bias the result.
    """
    force, force_map, rows = scratch.force, scratch.force_map, scratch.rows
    nonlinear, scale = terms.nonlinear_effects, memory.published[0]
    map_torques_to_base(terms, phase, constants, scratch)
    split_friction(memory, params, constants, scratch)
    force[:] = terms.mass_matrix @ scratch.acceleration + nonlinear
    scratch.torque[:] = memory.torque - scratch.friction - force[6:]
    scratch.residual[:] = force_map @ scratch.torque + force[:6]
    rows[:, SCALE] = (nonlinear[:6] - force_map @ nonlinear[6:]) / scale
    # At rest the torso's weight w at d needs the moment -w x d.
    scratch.weight[:] = -(scale * constants.torso_mass * GRAVITY * terms.base_rotation[2])
    skew(scratch.weight, rows[3:, COM:TILT])
    lowest = terms.foot_position[0, 2]
    for foot in range(1, terms.foot_position.shape[0]):
        lowest = min(lowest, terms.foot_position[foot, 2])
    moment = scale * constants.mass * GRAVITY * (terms.com[2] - lowest)
    rows[3, TILT], rows[4, TILT + 1] = moment, moment
    rows[:, FRICTION:] = -(force_map * scratch.unknown_friction)


@kernel
def map_torques_to_base(
    terms: DynamicsTerms, phase: PhaseState, constants: MassConstants, scratch: MassScratch
) -> None:
    """Compute the map G from joint torques to the generalised force on the base, leg by leg."""
    normal, coupling = scratch.normal, scratch.coupling
    scratch.force_map[:] = 0.0
    for foot in range(constants.leg_joints.shape[0]):
        joints, loaded = constants.leg_joints[foot], False
        normal[:] = 0.0
        coupling[:] = 0.0
        for point in range(constants.foot_of_point.shape[0]):
            if constants.foot_of_point[point] == foot and phase.stance[point]:
                loaded = True
                for axis in range(3):
                    add_jacobian_row(terms.contact_jacobian[point, axis], joints, scratch)
        if not loaded:
            continue
        for i in range(normal.shape[0]):
            normal[i, i] += _DAMPING
        solve_rows(normal, coupling)
        for i in range(joints.shape[0]):
            if joints[i] >= 0:
                scratch.force_map[:, joints[i]] = coupling[:, i]


@kernel
def add_jacobian_row(row: Array1D, joints: Indices1D, scratch: MassScratch) -> None:
    """Add a row of a point's Jacobian to the products J_j J_j' and J_b' J_j of its leg."""
    for i in range(joints.shape[0]):
        if joints[i] >= 0:
            lever_arm = row[6 + joints[i]]
            for k in range(i + 1):
                scratch.normal[i, k] += lever_arm * row[6 + joints[k]]
            scratch.coupling[:, i] += lever_arm * row[:6]


@kernel
def split_friction(
    memory: MassMemory, params: MassParameters, constants: MassConstants, scratch: MassScratch
) -> None:
    """Split the joints' friction into the part that their speed tells, and the unknown rest."""
    for i in range(constants.friction.shape[0]):
        speed = memory.velocity[6 + i]
        known_share = tanh(speed / params.friction_speed)
        scratch.friction[i] = constants.friction[i] * known_share + constants.damping[i] * speed
        unknown_share = 1.0 - (1.0 - params.friction_left) * abs(known_share)
        scratch.unknown_friction[i] = unknown_share * constants.friction[i]


@kernel
def correct_by_equation(
    k: int,
    terms: DynamicsTerms,
    memory: MassMemory,
    params: MassParameters,
    constants: MassConstants,
    scratch: MassScratch,
) -> None:
    """Correct the estimate by one of the six equations, unless it is an outlier."""
    row, gain, difference = scratch.rows[k], scratch.gain, scratch.difference
    difference[:] = memory.unknowns
    difference[:TILT] -= memory.published
    residual = -scratch.residual[k] - difference @ row
    noise = equation_noise(k, terms, constants)
    variance = noise * noise
    multiply_vector(memory.covariance, row, gain)
    for i in range(row.shape[0]):
        variance += row[i] * gain[i]
    if residual * residual > params.gate * params.gate * variance:
        return
    memory.unknowns[:] += gain * residual / variance
    for i in range(row.shape[0]):
        memory.covariance[i, :] -= gain[i] * gain / variance


@kernel
def equation_noise(k: int, terms: DynamicsTerms, constants: MassConstants) -> float:
    """Return the standard deviation of an equation's error [N, N m].

    The gyroscope's noise adds the inertia times the noise of the angular acceleration.
    """
    variance = constants.noise[k] * constants.noise[k]
    for j in range(3, 6):
        inertial = terms.mass_matrix[k, j] * constants.rotation_noise
        variance += inertial * inertial
    return math.sqrt(variance)
