"""Joint torques from the whole-body quadratic program."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.constants import GRAVITY
from ...mathematics.quadratic_program import QuadraticProgramSolver
from ...mathematics.rotations import from_matrix
from ...mathematics.whole_body_qp import (
    PYRAMID_ROWS,
    angular_task,
    assemble_cost,
    base_dynamics,
    contact_tasks,
    friction_pyramids,
    joint_torque,
    lifting_tasks,
    linear_task,
    motor_limits,
    share_weight,
    torque_limits,
    torso_task,
)
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import (
    DynamicsTerms,
    JointState,
    Phase,
    PhaseState,
    WholeBodyCommand,
    WholeBodyTarget,
)
from .task_gains import GainArrays, TaskGains

Array = NDArray[np.float64]


class SolverMemory(Signal):
    """What the controller remembers for when the solver fails."""

    torque = Field("n_joints", unit="N m", text="torque of the last solved program")
    failed = Field(dtype="int64", text="ticks since it was solved")
    failures = Field(dtype="int64", text="failures in all")


class WholeBodyController(Block):
    """The weighted whole-body quadratic program of the paper (V, wbc_qp), at every tick afresh.

    Over the generalised acceleration a and the forces f_j of the points in stance::

        minimise    sum_i |J_i a + J_i' v - x_i|^2_{W_i} + sum_j |f_j|^2_{W_f} + |a|^2_{W_a}
        subject to  H_b a + C_b v + G_b - sum_j J_{c_j,b}' f_j = 0            (base_dyn)
                    |f_x| <= mu f_z, |f_y| <= mu f_z, f_min <= f_z <= f_max   (cone)
                    torque limits, if any

    then the torque is tau = H_j a + C_j v + G_j - sum_j J_{c_j,j}' f_j (opt_torque). The tasks:

    1. Stance: contact points do not accelerate, softly. Points that are not in stance while
       others are go to the ground at their height: a task of zero acceleration never closes a
       gap, and a program that believes in a hovering heel pushes with nothing. In THRUST they
       are free to rise instead, as the heels do while the toes still push, and damped across
       their foot; the foot's last joint then follows the plan, feedforward and feedback.
    2. Linear momentum: x = a_ref + K_p (p_ref - p) + K_d (v_ref - v), per kg       (linear).
    3. Torso: x = K_p Log(R' R_ref) + K_d (w_ref - w), body frame.
    4. Angular momentum: x = -K_d k, or with ``track_angular_momentum`` k_ref' + K_d (k_ref - k).
       Its error is in N m and the torso's in rad/s^2; for equal say its weight must be larger
       by 1/I^2, about 160 for BRUCE.

    Limits: ``none`` is the paper's; ``joint`` bounds each joint's torque by the motor's peak;
    ``motor`` bounds the torque of every motor through the transmission by what it can give at
    its present speed, which is the truth of a robot with differential joints.

    The default thrust gains put lateral motion above roll and yaw momentum: where a thigh is level
    the hip's yaw and roll axes are in line, both cannot be had, and a jump should go straight up.

    ``stand`` gains hold in STAND and SQUAT, ``thrust`` in THRUST, ``landing`` after. Without a
    point in stance there is nothing to solve: torque, force and acceleration are zero, and the
    command counts as solved.

    Should the solver fail, the last solved torque is given times ``fallback_decay`` to the number
    of ticks since, for ``fallback_ticks`` ticks; after those the torque that carries the weight,
    shared equally by the points in stance, with no acceleration. Failures are counted.

    Does no feedback on joints (``JointPD`` does) and keeps no solver state: a cold start makes
    the answer a function of the inputs alone. The load report has a problem where
    the solver is not installed, or a foot is part of the base.
    """

    array_allocations = 12
    allocation_reason = "qpsolvers and the solver behind it return new arrays for every problem"

    class Params(Parameters):
        solver: str = parameter("daqp", text="any dense solver that qpsolvers finds installed")
        limits: Literal["none", "joint", "motor"] = parameter("motor", text="torque limits")
        torque_margin: float = live_parameter(
            0.97, gt=0.0, le=1.0, text="share of the limits that is used"
        )
        friction: float = live_parameter(0.5, gt=0.0, le=2.0, text="mu_c of the friction pyramid")
        force_min: float = live_parameter(
            0.0, unit="N", ge=0.0, text="least normal force of a point"
        )
        force_max: float = live_parameter(400.0, unit="N", gt=0.0, text="largest one")
        force_weight: float = live_parameter(1e-4, gt=0.0, text="W_f")
        acceleration_weight: float = live_parameter(1e-4, gt=0.0, text="W_a")
        stand: TaskGains = live_parameter(TaskGains(), text="gains while standing and squatting")
        thrust: TaskGains = live_parameter(
            TaskGains(
                linear_weight=(100.0, 600.0, 100.0),
                linear_stiffness=(100.0, 200.0, 500.0),
                linear_damping=(20.0, 30.0, 45.0),
                torso_weight=(1.0, 0.003, 1.0),
                angular_weight=(1e3, 1.5e4, 1e3),
                angular_damping=(30.0, 30.0, 30.0),
                track_angular_momentum=True,
            ),
            text="gains in the thrust: angular momentum before the torso",
        )
        landing: TaskGains = live_parameter(
            TaskGains(
                linear_weight=(107.0, 107.0, 107.0),
                linear_stiffness=(48.0, 60.0, 120.0),
                linear_damping=(13.0, 14.0, 22.0),
                torso_weight=(3.2, 3.2, 3.2),
                angular_weight=(0.5, 0.5, 0.5),
                angular_damping=(2.0, 2.0, 2.0),
            ),
            text="gains after touchdown",
        )
        fallback_ticks: int = parameter(5, ge=0, text="ticks the last torque is held on failure")
        fallback_decay: float = live_parameter(
            0.9, ge=0.0, le=1.0, text="factor on it per tick since the last solved program"
        )

    needs = ("floating base", "feet")
    params: Params
    terms = Input(DynamicsTerms, text="the whole-body model at the present state")
    target = Input(WholeBodyTarget, text="what to achieve")
    phase = Input(PhaseState, text="the phase and the points in stance")
    joints = Input(JointState, text="joint velocities, for the motors' limits")
    command = Output(WholeBodyCommand, text="torque, acceleration and contact forces")
    memory = State(SolverMemory, text="for when the solver fails")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """A solver that is installed, and feet that joints carry."""
        assert isinstance(params, cls.Params) and robot is not None
        try:
            QuadraticProgramSolver.check_name(params.solver)
        except LookupError as error:
            yield Misfit(str(error), parameter="solver", found=params.solver, fix="solver: daqp")
        for foot in robot.feet:
            if foot.link == robot.base:
                yield Misfit(f"foot {foot.name} of {robot.name} is part of the base, not of a leg")

    def setup(self) -> None:
        robot, p = self.robot, self.params
        self._solver = QuadraticProgramSolver(p.solver)
        self._profile = robot.profiles[robot.motors.profile]
        self._mass = robot.total_mass
        n_joints, n_contacts = len(robot.joints), len(robot.contacts)
        self._to_motor = robot.joint_to_motor
        motor = p.limits == "motor"
        self._transmission = robot.torque_to_motor if motor else np.eye(n_joints)
        limit_rows = 0 if p.limits == "none" else 2 * n_joints
        n = 6 + n_joints
        self.on_parameters()
        self._rows = np.zeros((3 * n_contacts + 9, n))
        self._desired, self._weights = np.zeros(len(self._rows)), np.zeros(len(self._rows))
        self._weighted, self._block = np.zeros_like(self._rows), np.zeros((n, n))
        self._vector, self._quaternion = np.zeros(n), np.zeros(4)
        self._error, self._product = np.zeros(3), np.zeros(n_joints)
        self._speed, self._offset = np.zeros(n_joints), np.zeros(n_joints)
        self._lower, self._upper = np.zeros(n_joints), np.zeros(n_joints)
        self._still = np.zeros(n)
        self._foot_of_point = np.array(robot.foot_of_contact(), dtype=np.int64)
        last = [[joint.child for joint in robot.joints].index(foot.link) for foot in robot.feet]
        self._ankles = 6 + np.array(last, dtype=np.int64)
        self._ankle_acceleration = np.zeros(len(last))
        self._active = np.zeros(n_contacts, dtype=np.int64)
        # A program of its own size for every number of points in stance: forces fixed to zero by
        # bounds would leave it without an interior.
        self._programs = [_Program.of(n, k, limit_rows) for k in range(n_contacts + 1)]

    def on_parameters(self) -> None:
        self._gains = {
            kind: GainArrays.of(getattr(self.params, kind))
            for kind in ("stand", "thrust", "landing")
        }

    def step(self) -> None:
        memory, command = self.memory, self.command
        count = self._find_stance()
        command.force[...] = 0.0
        command.acceleration[...] = 0.0
        if count == 0:
            command.torque[...] = 0.0
            memory.torque[...] = 0.0
            memory.failed[()] = 0
            command.solved[()] = True
            command.failures[()] = memory.failures
            return
        program = self._programs[count]
        self._set_tasks()
        self._assemble(program, count)
        answer = self._solver.solve(
            program.hessian, program.gradient, program.inequality, program.bound,
            program.equality, program.right,
        )  # fmt: skip
        if answer is None:
            self._fall_back()
        else:
            self._take(answer, count)
            memory.torque[...] = command.torque
            memory.failed[()] = 0
        command.solved[()] = answer is not None
        command.failures[()] = memory.failures

    def _find_stance(self) -> int:
        count = 0
        for point in range(self._active.shape[0]):
            if self.phase.stance[point]:
                self._active[count] = point
                count += 1
        return count

    def _set_tasks(self) -> None:
        terms, target = self.terms, self.target
        rows, desired, weights = self._rows, self._desired, self._weights
        phase = int(self.phase.phase)
        kind = "thrust" if phase == Phase.THRUST else "landing" if phase > Phase.THRUST else "stand"
        gains, first = self._gains[kind], rows.shape[0] - 9
        p = gains.source
        contact_tasks(
            terms.contact_jacobian, terms.contact_drift, terms.contact_position,
            terms.contact_velocity, self.phase.stance, p.stance_weight, p.stance_damping,
            p.swing_weight, p.swing_stiffness, p.swing_damping,
            rows[:first], desired[:first], weights[:first],
        )  # fmt: skip
        if phase == Phase.THRUST:
            self._follow_ankles(p)
            lifting_tasks(
                terms.contact_jacobian, terms.contact_drift, terms.contact_velocity,
                self.phase.stance, self._foot_of_point, terms.foot_rotation, p.swing_weight,
                p.swing_damping, self._ankles, self._ankle_acceleration, p.rolling_weight,
                rows[:first], desired[:first], weights[:first],
            )  # fmt: skip
        linear_task(
            terms.centroidal_matrix, terms.centroidal_drift, self._mass, terms.com,
            terms.com_velocity, target.com, target.com_velocity, target.com_acceleration,
            gains.linear_stiffness, gains.linear_damping,
            rows[first : first + 3], desired[first : first + 3],
        )  # fmt: skip
        from_matrix(terms.base_rotation, self._quaternion)
        torso_task(
            self._quaternion, terms.velocity[3:6], target.orientation, target.angular_velocity,
            gains.torso_stiffness, gains.torso_damping, self._error, self._quaternion,
            rows[first + 3 : first + 6], desired[first + 3 : first + 6],
        )  # fmt: skip
        angular_task(
            terms.centroidal_matrix, terms.centroidal_drift, terms.angular_momentum,
            target.angular_momentum, target.angular_momentum_rate, gains.angular_damping,
            p.track_angular_momentum, rows[first + 6 :], desired[first + 6 :],
        )  # fmt: skip
        weights[first:] = gains.weights

    def _follow_ankles(self, gains: TaskGains) -> None:
        """The acceleration that keeps every foot's last joint on the plan."""
        terms, target = self.terms, self.target
        for foot in range(self._ankles.shape[0]):
            velocity = int(self._ankles[foot])
            joint = velocity - 6
            self._ankle_acceleration[foot] = (
                float(target.joint_acceleration[joint])
                + gains.rolling_stiffness
                * (float(target.joint_position[joint]) - float(self.joints.position[joint]))
                + gains.rolling_damping
                * (float(target.joint_velocity[joint]) - float(terms.velocity[velocity]))
            )

    def _assemble(self, program: _Program, count: int) -> None:
        p, terms, profile = self.params, self.terms, self._profile
        active, n = self._active[:count], self._rows.shape[1]
        assemble_cost(
            self._rows, self._desired, self._weights, p.acceleration_weight, p.force_weight,
            self._weighted, self._block, self._vector, program.hessian, program.gradient,
        )  # fmt: skip
        base_dynamics(
            terms.mass_matrix, terms.nonlinear_effects, terms.contact_jacobian, active,
            program.equality, program.right,
        )  # fmt: skip
        cone = PYRAMID_ROWS * count
        friction_pyramids(
            count, n, p.friction, p.force_min, p.force_max,
            program.inequality[:cone], program.bound[:cone],
        )  # fmt: skip
        if p.limits == "none":
            return
        peak = p.torque_margin * profile.peak_torque
        if p.limits == "motor":
            np.dot(self._to_motor, self.joints.velocity, self._speed)
            motor_limits(
                self._speed, peak, profile.corner_speed, profile.no_load_speed,
                self._lower, self._upper,
            )  # fmt: skip
        else:
            self._lower[:], self._upper[:] = -peak, peak
        torque_limits(
            terms.mass_matrix, terms.nonlinear_effects, terms.contact_jacobian, active,
            self._transmission, self._lower, self._upper, program.torque_rows, self._offset,
            program.product, program.inequality[cone:], program.bound[cone:],
        )  # fmt: skip

    def _take(self, answer: Array, count: int) -> None:
        command, terms, n = self.command, self.terms, self._rows.shape[1]
        command.acceleration[...] = answer[:n]
        for j in range(count):
            command.force[self._active[j]] = answer[n + 3 * j : n + 3 * j + 3]
        joint_torque(
            terms.mass_matrix, terms.nonlinear_effects, terms.contact_jacobian,
            command.acceleration, command.force, self._product, command.torque,
        )  # fmt: skip

    def _fall_back(self) -> None:
        p, memory, command, terms = self.params, self.memory, self.command, self.terms
        memory.failed[()] += 1
        memory.failures[()] += 1
        failed = int(memory.failed)
        if failed <= p.fallback_ticks:
            np.multiply(memory.torque, p.fallback_decay**failed, out=command.torque)
            return
        share_weight(self.phase.stance, self._mass * GRAVITY, command.force)
        joint_torque(
            terms.mass_matrix, terms.nonlinear_effects, terms.contact_jacobian, self._still,
            command.force, self._product, command.torque,
        )  # fmt: skip


@dataclass(frozen=True)
class _Program:
    """The memory of the quadratic program with a certain number of points in stance."""

    hessian: Array
    gradient: Array
    equality: Array
    right: Array
    inequality: Array
    bound: Array
    torque_rows: Array
    product: Array

    @classmethod
    def of(cls, n: int, count: int, limit_rows: int) -> _Program:
        size, rows = n + 3 * count, PYRAMID_ROWS * count + limit_rows
        return cls(
            np.zeros((size, size)), np.zeros(size), np.zeros((6, size)), np.zeros(6),
            np.zeros((rows, size)), np.zeros(rows),
            np.zeros((n - 6, size)), np.zeros((n - 6, size)),
        )  # fmt: skip
