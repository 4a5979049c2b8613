"""Computes the joint torques by the whole-body quadratic program."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.constants import GRAVITY
from ...mathematics.quadratic_program import QuadraticProgramSolver
from ...mathematics.whole_body_qp import (
    Bounds,
    CostScratch,
    FrictionCone,
    RigidBodyTerms,
    TaskRows,
    TorqueSpeedCurves,
    assemble_cost,
    base_dynamics,
    friction_pyramids,
    joint_torque,
    motor_limits,
    share_weight,
    torque_limits,
)
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Context, Input, Misfit, Output, State
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
from .task_gains import TaskGains
from .tasks.choose import OWN_TASKS, PHASE_KINDS, ChosenTask, TaskChoiceError, choose_tasks
from .tasks.task import Situation, Task, TaskChoice
from .whole_body_program import WholeBodyProgram

Array = NDArray[np.float64]


class SolverMemory(Signal):
    """The state for ticks in which the solver fails."""

    torque = Field("n_joints", unit="N m", text="torque of the last solved program")
    failed = Field(dtype="int64", text="ticks since it was solved")
    failures = Field(dtype="int64", text="failures in all")


class WholeBodyController(Block):
    """The weighted whole-body quadratic program of the paper (V, wbc_qp), solved in every tick.

    Over the generalised acceleration a and the forces f_j of the points in stance::

        minimise    sum_i |J_i a - d_i|^2_{W_i} + sum_j |f_j|^2_{W_f} + |a|^2_{W_a}
        subject to  H_b a + C_b v + G_b - sum_j J_{c_j,b}' f_j = 0            (base_dyn)
                    |f_x| <= mu f_z, |f_y| <= mu f_z, f_min <= f_z <= f_max   (cone)
                    torque limits, if any

    then the torque is tau = H_j a + C_j v + G_j - sum_j J_{c_j,j}' f_j (opt_torque).

    **Tasks.** The objectives are a list of tasks, each a small class in ``blocks/control/tasks``
    with its error, its Jacobian and its gains: ``ContactPoints``, ``LinearMomentum``,
    ``TorsoOrientation``, ``AngularMomentum`` (the paper's tasks 1 to 4) and ``Posture``, which
    keeps joints that belong to no leg at their angles. A graph chooses others with ``tasks``; an
    entry is the name of a task, or ``{task: module:Class, gains: {...}}`` for a class of the user's
    own and for gains of one entry alone. See ``docs/whole_body.md``.

    ``stand`` gains hold in STAND and SQUAT, ``thrust`` in THRUST, ``landing`` after. The default
    thrust gains give lateral motion priority over roll and yaw momentum: where a thigh is level the
    hip's yaw and roll axes are in line, not both can be controlled, and a jump should go straight
    up.

    **Limits** on torque are those of the robot's actuator profile in use. ``none``, as in the
    paper, sets no limits. ``joint`` bounds each joint's torque by the peak torque of the motor with
    the same index. ``motor`` bounds the torque of every motor, through the transmission, by its
    torque-speed curve at its present speed, which is exact also for differential joints.

    Without a point in stance there is nothing to solve: torque, force and acceleration are zero,
    and the command counts as solved.

    If the solver fails, the torque is the last solved one times ``fallback_decay`` to the power of
    the number of ticks since, for ``fallback_ticks`` ticks. After these it is the torque that
    carries the weight, shared equally by the points in stance, with no acceleration. Failures are
    counted.

    The block works for any robot with a floating base and feet. It does no feedback on joints
    (``JointPD`` does) and keeps no solver state: with a cold start the solution depends on the
    inputs alone. The load report names a solver that is not installed, an unknown task or gain, and
    feet that can carry no load.
    """

    array_allocations = 12
    allocation_reason = "qpsolvers and the solver behind it return new arrays for every problem"

    class Params(Parameters):
        tasks: list[str | TaskChoice] = parameter(
            list(OWN_TASKS), min_length=1, text="the tasks, each an objective for the acceleration"
        )
        solver: str = parameter("daqp", text="any dense solver that qpsolvers finds installed")
        limits: Literal["none", "joint", "motor"] = parameter("motor", text="torque limits")
        torque_margin: float = live_parameter(
            0.97, gt=0.0, le=1.0, text="share of the limits that is used"
        )
        friction: float = live_parameter(0.5, gt=0.0, le=2.0, text="mu_c of the friction pyramid")
        force_min: float = live_parameter(
            0.0, unit="N", ge=0.0, text="least normal force of a point"
        )
        force_max: float | None = live_parameter(
            None,
            unit="N",
            gt=0.0,
            text="largest normal force of a point; none: eight times the robot's weight",
        )
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
            text="gains in the thrust; angular momentum matters more than the torso there",
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
            0.9, ge=0.0, le=1.0, text="factor on that torque per tick since the last solution"
        )

    needs = ("floating base", "feet")
    params: Params
    terms = Input(DynamicsTerms, text="the whole-body model at the present state")
    target = Input(WholeBodyTarget, text="what to achieve")
    phase = Input(PhaseState, text="the phase and the points in stance")
    joints = Input(JointState, text="joint angles and velocities")
    command = Output(WholeBodyCommand, text="torque, acceleration and contact forces")
    memory = State(SolverMemory, text="used when the solver fails")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """Report a solver that is not installed, and feet that can carry no load."""
        assert isinstance(params, cls.Params) and robot is not None
        if not robot.contacts:
            yield Misfit(f"{robot.name} has no contact points, so its feet can carry no load")
        try:
            QuadraticProgramSolver.check_name(params.solver)
        except LookupError as error:
            yield Misfit(str(error), parameter="solver", found=params.solver, fix="solver: daqp")
        for foot in robot.feet:
            if foot.link == robot.base:
                yield Misfit(f"foot {foot.name} of {robot.name} is part of the base, not of a leg")

    @classmethod
    def requires_of_graph(cls, params: Parameters, context: Context) -> Iterable[Misfit]:
        """Report unknown tasks, and gains that a task does not have or that misfit the robot."""
        assert isinstance(params, cls.Params)
        try:
            for chosen in choose_tasks(params.tasks, (context.graph_folder, context.folder)):
                found: dict[str, None] = {}
                for kind in PHASE_KINDS:
                    gains = chosen.gains(kind, getattr(params, kind))
                    if context.robot is not None:
                        found.update(dict.fromkeys(chosen.kind.misfits(context.robot, gains)))
                for reason in found:
                    yield Misfit(f"task {chosen.entry.task}: {reason}", parameter="tasks")
        except TaskChoiceError as error:
            yield Misfit(str(error), parameter="tasks")

    def setup(self) -> None:
        robot, p = self.robot, self.params
        self._solver = QuadraticProgramSolver(p.solver)
        self._weight = robot.total_mass * GRAVITY
        n_joints, n_contacts, n = len(robot.joints), len(robot.contacts), 6 + len(robot.joints)
        self._motors, self._to_motor = robot.motors, robot.joint_to_motor
        motor = p.limits == "motor"
        self._transmission = robot.torque_to_motor if motor else np.eye(n_joints)
        limit_rows = 0 if p.limits == "none" else 2 * n_joints
        self._bounds = Bounds(np.zeros(n_joints), np.zeros(n_joints))
        self._curves = TorqueSpeedCurves(
            np.zeros(n_joints), self._motors.corner_speed, self._motors.no_load_speed
        )
        self._speed, self._product, self._still = (
            np.zeros(n_joints),
            np.zeros(n_joints),
            np.zeros(n),
        )
        terms = self.terms
        self._model = RigidBodyTerms(
            terms.mass_matrix, terms.nonlinear_effects, terms.contact_jacobian
        )
        self._build_tasks(robot, n)
        self.on_parameters()
        self._active = np.zeros(n_contacts, dtype=np.int64)
        # There is a program for every number of points in stance, each of its own size, because
        # fixing forces to zero by bounds would leave the feasible set without an interior.
        self._programs = [
            WholeBodyProgram.of_size(n, count, limit_rows) for count in range(n_contacts + 1)
        ]

    def _build_tasks(self, robot: RobotDescription, n: int) -> None:
        """The chosen tasks, each with its part of the rows."""
        situation = Situation(robot, self.terms, self.target, self.phase, self.joints)
        self._chosen: tuple[ChosenTask, ...] = choose_tasks(
            self.params.tasks, (self.context.graph_folder, self.context.folder)
        )
        counts = [
            chosen.kind.row_count(robot, chosen.gains("stand", self.params.stand))
            for chosen in self._chosen
        ]
        total = sum(counts)
        self._rows = TaskRows(np.zeros((total, n)), np.zeros(total), np.zeros(total))
        self._scratch = CostScratch(np.zeros((total, n)), np.zeros((n, n)), np.zeros(n))
        self._tasks: list[Task[Any]] = []
        first = 0
        for chosen, count in zip(self._chosen, counts, strict=True):
            own = TaskRows(*(array[first : first + count] for array in self._rows))
            self._tasks.append(chosen.kind(situation, own))
            first += count

    def on_parameters(self) -> None:
        p = self.params
        most = 8.0 * self._weight if p.force_max is None else p.force_max
        self._cone = FrictionCone(p.friction, p.force_min, most)
        np.multiply(p.torque_margin, self._motors.peak_torque, out=self._curves.peak)
        self._gains = {
            kind: [
                task.prepare(chosen.gains(kind, getattr(p, kind)))
                for chosen, task in zip(self._chosen, self._tasks, strict=True)
            ]
            for kind in PHASE_KINDS
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
        phase = int(self.phase.phase)
        kind = "thrust" if phase == Phase.THRUST else "landing" if phase > Phase.THRUST else "stand"
        gains = self._gains[kind]
        for i in range(len(gains)):
            self._tasks[i].update(gains[i])
        self._assemble(program, count)
        answer = self._solver.solve(
            program.cost.hessian, program.cost.gradient,
            program.inequality.matrix, program.inequality.bound,
            program.equality.matrix, program.equality.bound,
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

    def _assemble(self, program: WholeBodyProgram, count: int) -> None:
        p = self.params
        active, n = self._active[:count], self._still.shape[0]
        assemble_cost(
            self._rows, p.acceleration_weight, p.force_weight, self._scratch, program.cost
        )
        base_dynamics(self._model, active, program.equality)
        friction_pyramids(count, n, self._cone, program.cones)
        if p.limits == "none":
            return
        if p.limits == "motor":
            np.dot(self._to_motor, self.joints.velocity, self._speed)
            motor_limits(self._speed, self._curves, self._bounds)
        else:
            self._bounds.upper[:] = self._curves.peak
            np.negative(self._curves.peak, self._bounds.lower)
        torque_limits(
            self._model, active, self._transmission, self._bounds, program.scratch, program.limits
        )

    def _take(self, answer: Array, count: int) -> None:
        command, n = self.command, self._still.shape[0]
        command.acceleration[...] = answer[:n]
        for j in range(count):
            command.force[self._active[j]] = answer[n + 3 * j : n + 3 * j + 3]
        joint_torque(
            self._model, command.acceleration, command.force, self._product, command.torque
        )

    def _fall_back(self) -> None:
        p, memory, command = self.params, self.memory, self.command
        memory.failed[()] += 1
        memory.failures[()] += 1
        failed = int(memory.failed)
        if failed <= p.fallback_ticks:
            np.multiply(memory.torque, p.fallback_decay**failed, out=command.torque)
            return
        share_weight(self.phase.stance, self._weight, command.force)
        joint_torque(self._model, self._still, command.force, self._product, command.torque)
