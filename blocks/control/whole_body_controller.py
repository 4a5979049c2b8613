"""Computes the joint torques by the whole-body quadratic program."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ...mathematics.arrays import Array1D, Indices1D
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...mathematics.whole_body_qp import (
    JOINT_LIMITS,
    MOTOR_LIMITS,
    NO_LIMITS,
    SOLVED,
    ProgramWeights,
    RigidBodyTerms,
    TaskRows,
    TorqueLimits,
    WholeBodyProgram,
    WholeBodySolution,
)
from ...mathematics.whole_body_reduction import reduce_program, reduction_memory
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.per_joint import PerJoint
from ...runtime.language.signals import Field, Signal
from ...runtime.language.steps import PythonCall, signal_call
from ..signals import (
    DynamicsTerms,
    JointState,
    MotorCondition,
    Phase,
    PhaseState,
    WholeBodyCommand,
    WholeBodyTarget,
)
from .frames import FrameModel
from .tasks.task import (
    PHASE_KINDS,
    ChosenTask,
    Task,
    TaskChoice,
    TaskChoiceError,
    choose_tasks,
    own_tasks,
)
from .whole_body_solver import ACTIVE_SET, check_solver, fallback_call, solver_call

PAPER_TASKS = (
    "ContactPoints", "LinearMomentum", "TorsoOrientation", "AngularMomentum", "Posture",
)  # fmt: skip
"""The tasks of a controller whose graph names none; the controller has their gains in common."""


class TaskGains(*(own_tasks()[name].Gains for name in reversed(PAPER_TASKS))):  # type: ignore[misc]
    """Weights and gains of the paper's tasks in one kind of phase. Vectors are x, y, z: the world's for
    momentum, the body's for the torso."""


class SolverMemory(Signal):
    """The state for ticks in which the solver fails."""

    torque = Field("n_joints", unit="N m", text="torque of the last solved program")
    failed = Field(dtype="int64", text="ticks since it was solved")
    failures = Field(dtype="int64", text="failures in all")


class WholeBodyController(KernelBlock):
    """The weighted whole-body quadratic program of the paper (V, wbc_qp), solved in every tick.

    Over the generalised acceleration a and the forces f_j of the points in stance::

        minimise    sum_i |J_i a - d_i|^2_{W_i} + sum_j |f_j|^2_{W_f} + |a|^2_{W_a}
        subject to  H_b a + C_b v + G_b - sum_j J_{c_j,b}' f_j = 0            (base_dyn)
                    |f_x| <= mu f_z, |f_y| <= mu f_z, f_min <= f_z <= f_max   (cone)
                    or, with ``cones: round``, |(f_x, f_y)| <= mu f_z
                    torque limits, if any

    then the torque is tau = H_j a + C_j v + G_j - sum_j J_{c_j,j}' f_j (opt_torque).

    **Tasks.** The objectives are a list of tasks, each a small class in ``blocks/control/tasks``
    with its error, its Jacobian and its gains: ``ContactPoints``, ``LinearMomentum``,
    ``TorsoOrientation``, ``AngularMomentum`` (the paper's tasks 1 to 4) and ``Posture``, which
    keeps joints that belong to no leg at their angles. A graph chooses others with ``tasks``; an
    entry is the name of a task, or ``{task: module:Class, gains: {...}}`` for a class of the user's
    own and for gains of one entry alone. A task with a target of its own, such as
    ``FramePosition``, adds an input. See ``docs/whole_body.md``.

    ``stand`` gains hold in STAND and SQUAT, ``thrust`` in THRUST, ``landing`` after. The default
    thrust gains give lateral motion priority over roll and yaw momentum: where a thigh is level the
    hip's yaw and roll axes are in line, not both can be controlled, and a jump should go straight
    up.

    **Limits** on torque are those of the robot's actuator profile in use. ``none``, as in the
    paper, sets no limits. ``joint`` bounds each joint's torque by the peak torque of the motor with
    the same index. ``motor`` bounds the torque of every motor, through the transmission, by its
    torque-speed curve at its present speed, which is exact also for differential joints; with
    ``follow_motors`` by the shares of torque and speeds that are left of them by the input ``motors``.

    **Solution.** Accelerations are eliminated exactly (``mathematics/whole_body_reduction``), and ``solver``
    finds the contact forces. ``active_set`` is a dual active-set method that starts cold, so the
    solution is exact up to rounding and depends on the inputs alone; with ``cones: round`` it solves
    the program with the cones themselves, as exactly (``mathematics/whole_body_cones``). Any other name is
    that of a library's solver: ``daqp``, ``quadprog``, ``osqp``, ``clarabel``, ``proxqp``, ``piqp`` are tested, and only Clarabel
    takes round cones. An answer that is not optimal is none. Where a library finds no solution, the own method is tried; where that finds none with round cones, the pyramids inside them are.

    Without a point in stance there is nothing to solve: torque, force and acceleration are zero,
    and the command counts as solved.

    If no solution is found, the torque is the last solved one times ``fallback_decay`` to the power of
    the number of ticks since, for ``fallback_ticks`` ticks. After these it is the torque that
    carries the weight, shared equally by the points in stance, with no acceleration. Failures are
    counted.

    The block works for any robot with a floating base and feet. It does no feedback on joints
    (``JointPD`` does) and keeps no solver state. The load report names a solver that is not installed, an unknown task or gain, and
    feet that can carry no load.
    """

    array_allocations = 14
    allocation_reason = (
        "solvers of libraries, which follow where the own method fails, return new arrays"
    )

    class Params(Parameters):
        tasks: list[str | TaskChoice] = parameter(
            list(PAPER_TASKS),
            min_length=1,
            text="the tasks, each an objective for the acceleration",
        )
        solver: str = parameter(
            ACTIVE_SET,
            text="active_set, or a library's solver: daqp, quadprog, osqp, clarabel, proxqp, piqp",
        )
        cones: Literal["pyramid", "round"] = parameter(
            "pyramid", text="shape of the friction cones; the paper's are pyramids"
        )
        limits: Literal["none", "joint", "motor"] = parameter("motor", text="torque limits")
        torque_margin: float = live_parameter(
            0.97, gt=0.0, le=1.0, text="share of the limits that is used"
        )
        peak_torque: PerJoint = live_parameter(
            PerJoint(1.0), gt=0.0,
            text="factor on the peak torque of each motor, by the name of its joint",
        )  # fmt: skip
        follow_motors: bool = parameter(
            False,
            text="the limits follow the present condition of motors and pack, by an input `motors`",
        )
        friction: float = live_parameter(0.5, gt=0.0, le=2.0, text="mu_c of the friction cones")
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
                angular_by_size=True,
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
    target = Input(WholeBodyTarget, text="target of the whole body")
    phase = Input(PhaseState, text="the phase and the points in stance")
    joints = Input(JointState, text="joint angles and velocities")
    command = Output(WholeBodyCommand, text="torque, acceleration and contact forces")
    memory = State(SolverMemory, text="used when the solver fails")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a solver that is not installed, feet that can carry no load, and wrong tasks."""
        robot = context.robot
        assert isinstance(params, cls.Params) and robot is not None
        if not robot.contacts:
            yield UnmetRequirement(
                f"{robot.name} has no contact points, so its feet can carry no load"
            )
        try:
            check_solver(params.solver, params.cones)
        except LookupError as error:
            yield UnmetRequirement(
                str(error), parameter="solver", found=params.solver, fix=f"solver: {ACTIVE_SET}"
            )
        for foot in robot.feet:
            if foot.link == robot.base:
                yield UnmetRequirement(
                    f"foot {foot.name} of {robot.name} is part of the base, not of a leg"
                )
        try:
            for chosen in choose_tasks(params.tasks, (context.graph_folder, context.folder)):
                found: dict[str, None] = {}
                for kind in PHASE_KINDS:
                    gains = chosen.params(kind, getattr(params, kind))
                    found.update(dict.fromkeys(chosen.kind.unmet_requirements(gains, robot)))
                for reason in found:
                    yield UnmetRequirement(f"task {chosen.entry.task}: {reason}", parameter="tasks")
        except TaskChoiceError as error:
            yield UnmetRequirement(str(error), parameter="tasks")

    @classmethod
    def specialize(
        cls,
        params: Parameters,
        folder: Path,
        robot: RobotDescription | None = None,
        graph_folder: Path | None = None,
    ) -> type[Block]:
        """Make the class with the inputs of the tasks; a list that cannot be used is reported later."""
        assert isinstance(params, cls.Params)
        try:
            chosen = choose_tasks(params.tasks, (graph_folder or folder, folder))
        except TaskChoiceError:
            return cls
        inputs = [(each.kind, own, name) for each in chosen for own, name in each.inputs.items()]
        if not inputs and not params.follow_motors:
            return cls
        return _class_with(tuple(inputs), params.follow_motors)

    def setup(self) -> None:
        robot, p, terms, command = self.robot, self.params, self.terms, self.command
        now: MotorCondition | None = getattr(self, "motors", None)
        shares = (
            (now.torque_constant, now.corner_speed, now.no_load_speed) if now is not None else ()
        )
        self._weight = robot.weight
        n_joints, n_contacts, n = len(robot.joints), len(robot.contacts), 6 + len(robot.joints)
        self._weights = ProgramWeights(*(np.zeros(1) for _ in ProgramWeights._fields))
        by_motor = p.limits == "motor"
        motors, kinds = (
            robot.motors,
            {"none": NO_LIMITS, "joint": JOINT_LIMITS, "motor": MOTOR_LIMITS},
        )
        self._motors = TorqueLimits(
            kinds[p.limits], robot.joint_to_motor,
            robot.torque_to_motor if by_motor else np.eye(n_joints),
            np.zeros(n_joints), motors.corner_speed, motors.no_load_speed,
            *(shares or np.ones((3, n_joints))),
            *(np.zeros(n_joints) for _ in range(3)),
        )  # fmt: skip
        self._model = RigidBodyTerms(
            terms.mass_matrix, terms.nonlinear_effects, terms.contact_jacobian
        )
        self._chosen: tuple[ChosenTask, ...] = choose_tasks(
            p.tasks, (self.context.graph_folder, self.context.folder)
        )
        self._make_tasks(n)
        self._program = WholeBodyProgram(
            self._rows, self._model, self.phase.stance, self.joints.velocity, self._weights,
            self._motors,
        )  # fmt: skip
        self._code = np.zeros(1, dtype=np.int64)
        reduction = reduction_memory(n, n_contacts)
        solution = WholeBodySolution(
            command.torque, command.acceleration, command.force, self._code
        )
        self._reduce = KernelCall(reduce_program, self._program, reduction, solution)
        problem = self._program, reduction, solution
        self._solve = solver_call(p.solver, p.cones, *problem)
        self._inscribed = np.zeros(1)
        self._fallback = fallback_call(
            p.solver, p.cones, self._program, self._inscribed, reduction, solution
        )
        self._active_calls = ActiveCalls(*(np.zeros(1, np.int64) for _ in ActiveCalls._fields))
        self._unsolved = np.zeros(1, np.int64)
        self._activate = signal_call(activate_calls, self.phase, self._active_calls)
        self._keep = signal_call(
            keep_solution, self._active_calls.loaded, self._code, command, self.memory,
            self._unsolved,
        )  # fmt: skip
        self._hold_settings = HoldSettings(np.zeros(1, np.int64), np.zeros(1), np.zeros(1))
        self._hold = signal_call(
            hold_torque, self._unsolved, self.phase, self._model, command, self.memory,
            self._hold_settings,
        )  # fmt: skip
        self._arrange()

    def _make_tasks(self, n: int) -> None:
        """Make the tasks for each kind of phase; those of one entry share their part of the rows."""
        params = {kind: self._task_params(kind) for kind in PHASE_KINDS}
        counts = [
            chosen.kind.row_count(each, self.robot)
            for chosen, each in zip(self._chosen, params["stand"], strict=True)
        ]
        total = sum(counts)
        self._rows = TaskRows(np.zeros((total, n)), np.zeros(total), np.zeros(total))
        self._frames = FrameModel(self.robot, self.terms, self.joints)
        self._tasks: dict[str, list[Task]] = {}
        for kind in PHASE_KINDS:
            first, tasks = 0, []
            for chosen, count, each in zip(self._chosen, counts, params[kind], strict=True):
                rows = TaskRows(*(array[first : first + count] for array in self._rows))
                ports: dict[str, Any] = {
                    "terms": self.terms, "target": self.target, "phase": self.phase,
                    "joints": self.joints,
                }  # fmt: skip
                ports |= {own: getattr(self, name) for own, name in chosen.inputs.items()}
                tasks.append(chosen.kind(each, rows, ports, self._frames, self.context))
                first += count
            self._tasks[kind] = tasks

    def _task_params(self, kind: str) -> list[Parameters]:
        """Return the parameters of all tasks in a kind of phase."""
        return [chosen.params(kind, getattr(self.params, kind)) for chosen in self._chosen]

    def prepare(self) -> None:
        p, weights, hold = self.params, self._weights, self._hold_settings
        hold.ticks[0], hold.decay[0], hold.weight[0] = (
            p.fallback_ticks, p.fallback_decay, self._weight,
        )  # fmt: skip
        weights.acceleration[0], weights.force[0] = p.acceleration_weight, p.force_weight
        weights.friction[0], weights.force_min[0] = p.friction, p.force_min
        self._inscribed[0] = math.sqrt(0.5) * p.friction
        weights.force_max[0] = 8.0 * self._weight if p.force_max is None else p.force_max
        peak = p.peak_torque.resolve(self.robot) * self.robot.motors.peak_torque
        np.multiply(p.torque_margin, peak, out=self._motors.peak)
        changed = {kind: self._task_params(kind) for kind in PHASE_KINDS}
        for kind, params in changed.items():
            for task, each in zip(self._tasks[kind], params, strict=True):
                task.change(each)

    def _arrange(self) -> None:
        """Put the calls of a step in order."""
        calls: list[KernelCall | PythonCall] = []
        for kind in PHASE_KINDS:
            for task in self._tasks[kind]:
                for call in task.calls():
                    call.when = getattr(self._active_calls, kind)
                    calls.append(call)
        for call in (*self._frames.calls, self._reduce, self._solve):
            call.when = self._active_calls.loaded
        self.kernel_calls = (
            self._activate, *self._frames.calls, *calls, self._reduce, self._solve, self._keep,
        )  # fmt: skip
        self.event = self._unsolved
        again = () if self._fallback is None else (self._fallback, self._keep)
        self.event_calls = (*again, self._hold)

    def on_event(self) -> None:
        """Fall back where the chosen solver has found no solution."""
        for call in self.event_calls:
            call.run()


@cache
def _class_with(
    inputs: tuple[tuple[type[Task], str, str], ...], follow_motors: bool
) -> type[WholeBodyController]:
    """Make the controller with inputs for tasks, each given by the task, its name there and here, and for motors."""
    body: dict[str, Any] = {
        "__doc__": WholeBodyController.__doc__,
        "__module__": WholeBodyController.__module__,
    }
    for kind, own, name in inputs:
        port = kind.inputs[own]
        body[name] = Input(port.signal, text=port.text, default=port.default)
    if follow_motors:
        text = "what is left of the motors' torque constants and speeds"
        body["motors"] = Input(MotorCondition, text=text)
    return type(WholeBodyController.__name__, (WholeBodyController,), body)


class ActiveCalls(NamedTuple):
    """The calls that a step makes, each (1,) and not zero where it makes them: the tasks with the gains of ``stand``,
    ``thrust`` or ``landing``, and the solver of the program if a point is ``loaded``."""

    stand: Indices1D
    thrust: Indices1D
    landing: Indices1D
    loaded: Indices1D


@kernel
def activate_calls(phase: PhaseState, active: ActiveCalls) -> None:
    """Find which gains hold in the phase, and whether a point is in stance."""
    loaded = 0
    for i in range(phase.stance.shape[0]):
        if phase.stance[i]:
            loaded = 1
    active.stand[0] = loaded if phase.phase < Phase.THRUST else 0
    active.thrust[0] = loaded if phase.phase == Phase.THRUST else 0
    active.landing[0] = loaded if phase.phase > Phase.THRUST else 0
    active.loaded[0] = loaded


@kernel
def keep_solution(
    loaded: Indices1D,
    code: Indices1D,
    command: WholeBodyCommand,
    memory: SolverMemory,
    unsolved: Indices1D,
) -> None:
    """Remember a solution, or without a point in stance make everything zero.

    Args:
        loaded: whether a point is in stance, (1,).
        code: SOLVED where the program has been solved, (1,).
        unsolved: becomes 1 where it has not, else 0, (1,); then nothing else is written.
    """
    unsolved[0] = 0
    if loaded[0] == 0:
        command.force[:, :] = 0.0
        command.acceleration[:] = 0.0
        command.torque[:] = 0.0
        memory.torque[:] = 0.0
    elif code[0] == SOLVED:
        memory.torque[:] = command.torque
    else:
        unsolved[0] = 1
        return
    memory.failed = 0
    command.solved = True
    command.failures = memory.failures


class HoldSettings(NamedTuple):
    """Settings for ticks without a solution, each (1,): the number of ``ticks`` for which the last torque is held, the
    factor by which it decays in each, and the robot's ``weight`` [N]."""

    ticks: Indices1D
    decay: Array1D
    weight: Array1D


@kernel
def hold_torque(
    unsolved: Indices1D,
    phase: PhaseState,
    model: RigidBodyTerms,
    command: WholeBodyCommand,
    memory: SolverMemory,
    settings: HoldSettings,
) -> None:
    """Hold the last solved torque where the program is ``unsolved`` (1,): it decays, and then gives way to the torque
    that carries the weight."""
    if unsolved[0] == 0:
        return
    memory.failed += 1
    memory.failures += 1
    command.solved = False
    command.failures = memory.failures
    command.force[:, :] = 0.0
    command.acceleration[:] = 0.0
    if memory.failed <= settings.ticks[0]:
        share = 1.0
        for _ in range(int(memory.failed)):
            share *= settings.decay[0]
        command.torque[:] = share * memory.torque
        return
    loaded = 0
    for point in range(phase.stance.shape[0]):
        if phase.stance[point]:
            loaded += 1
    for joint in range(command.torque.shape[0]):
        command.torque[joint] = model.nonlinear[6 + joint]
    for point in range(phase.stance.shape[0]):
        if phase.stance[point]:
            command.force[point, 2] = settings.weight[0] / loaded
            for joint in range(command.torque.shape[0]):
                command.torque[joint] -= (
                    command.force[point, 2] * model.jacobian[point, 2, 6 + joint]
                )
