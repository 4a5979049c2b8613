"""Estimates what the robot weighs, and where its torso's centre of mass is, while it stands."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.constants import GRAVITY
from ...mathematics.mass_filter import BaseForceScratch
from ...robots.description import RobotDescription
from ...robots.limb import chain_to
from ...runtime.language.block import Block, Input, Metric, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import DynamicsTerms, JointState, MassEstimate, PhaseState
from .mass_equations import (
    COM,
    FRICTION,
    SCALE,
    TILT,
    Measured,
    Memory,
    Model,
    Scratch,
    Settings,
    follow_mass,
    publish_mass,
)


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
    The height of the torso's centre of mass is hardly observable while the torso is level. The
    acceleration is as noisy as the gyroscope, ``gyro_noise``. What this does to the moments grows
    with the robot's inertia: a filter that does not count with it finds the centre of mass of a
    robot of 87 kg 3 cm off. In a robot as small as BRUCE ``moment_noise`` covers it.

    Before anything is measured the estimate is ``mass`` and ``com_offset``, by default the
    description's, with the standard deviations ``mass_spread`` and ``com_spread``. Equations further
    than ``gate`` standard deviations off, such as those during a push, are left out. The outputs
    follow the estimate with the time constant ``smoothing``, because controllers follow them. From
    the first thrust on the estimate stays.

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
        robot, p, n = self.robot, self.params, len(self.robot.joints)
        self._mass = robot.total_mass
        memory = Memory(*(getattr(self.memory, name) for name in Memory._fields))
        every = max(1, round(p.interval / self.period))
        weight = self._mass * GRAVITY
        share = min(1.0, self.period / p.filter_time)
        settings = Settings(
            self.period, every, math.ceil(p.settle_time / self.period - 1e-9), share,
            min(1.0, self.period / p.smoothing) if p.smoothing else 1.0,
            math.exp(-every * self.period / p.friction_time), float(p.friction_share),
            p.friction_speed, float(p.friction_left), p.gate,
            np.array([p.force_noise * weight] * 3 + [p.moment_noise * weight] * 3),
            # of the derivative of white noise behind a low-pass filter of the first order
            p.gyro_noise * share / self.period * math.sqrt(2.0 / (2.0 - share)),
        )  # fmt: skip
        terms, phase, out = self.terms, self.phase, self.estimate
        measured = Measured(
            phase.phase, phase.stance, terms.velocity, self.joints.torque, terms.mass_matrix,
            terms.nonlinear_effects, terms.contact_jacobian, terms.base_rotation, terms.com,
            terms.foot_position,
        )  # fmt: skip
        legs = [chain_to(robot, foot.link) for foot in robot.feet]
        self._follow = KernelCall(
            follow_mass, measured, memory, _model(robot, legs), settings,
            _scratch(n, FRICTION + n, max(map(len, legs))),
        )  # fmt: skip
        self._publish = KernelCall(
            publish_mass, self._mass, memory, out.mass, out.mass_std, out.com_offset,
            out.com_offset_std,
        )  # fmt: skip

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
        self._publish.run()

    def update(self) -> None:
        self._follow.run()

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


def _model(robot: RobotDescription, legs: list[tuple[int, ...]]) -> Model:
    """What the equations take from the robot's description; ``legs`` are the joints of each foot's."""
    chains = np.full((len(legs), max(map(len, legs))), -1)
    for foot, leg in enumerate(legs):
        chains[foot, : len(leg)] = leg
    torso = next(link.mass for link in robot.links if link.name == robot.base)
    return Model(
        robot.total_mass, torso, robot.motors.friction, robot.motors.damping,
        np.array(robot.foot_of_contact(), np.int64), chains,
    )  # fmt: skip


def _scratch(n: int, size: int, longest: int) -> Scratch:
    """Memory for ``n`` joints, ``size`` unknowns and legs of up to ``longest`` joints."""
    leg = BaseForceScratch(np.zeros((longest, longest)), np.zeros((6, longest)))
    shapes = (6, n), (6, size), 6 + n, 6 + n, n, n, n, 6, 6, size
    return Scratch(leg, *(np.zeros(shape) for shape in shapes))
