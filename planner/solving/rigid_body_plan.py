"""Plans a task in the ``srbm`` formulation.

The motion of the whole robot follows from that of the single rigid body by inverse kinematics.

The robot takes over the rigid body's centre of mass and attitude, and its feet stand where they were
planned. In flight each foot goes, seen from the centre of mass, from where it left the ground to
where it lands; within ``BLEND`` of both it gains and loses speed, so that it is at rest on the
ground. So the linear momentum is the planned one, but the angular momentum is not, because the legs add
theirs.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.rotations import matrices_of_quaternions
from ...robots.description import RobotDescription
from ..models.euler_angles import pose_of, twist_of
from ..models.robot_model import Stance, model_of, stances_of
from ..models.simple_models import BLEND, RigidBody, composite_inertia
from ..models.symbolic_model import SymbolicModel
from ..problem import rigid_body_problem as stages
from ..problem.program import SimpleProblem
from ..problem.rigid_body_problem import STATES, RigidBodyProblemBuilder
from ..task.files import PlanError
from ..task.phase import Phase
from ..task.plan import PlannedJump
from ..task.task import JumpTask
from .kept_functions import FunctionSet, Progress, SolveOptions, load_functions
from .outcome import failure, motion_arrays, statistics_of, versions
from .solver import solve
from .solver_process import cpu_time

RATE_STEP = 1e-6
"""s, of the differences that give the feet's velocities."""


class FeetPath:
    """The contact points over the flight of a centre of mass.

    ``com`` and ``speed`` are its states at lift-off and touchdown, ``times`` the two instants.
    """

    def __init__(
        self, stances: tuple[Stance, Stance], com: Array, speed: Array, times: tuple[float, float]
    ) -> None:
        self.stances, self.com, self.speed, self.times = stances, com, speed, times
        self.blend = min(BLEND, 0.5 * (times[1] - times[0]))

    def at(self, time: float, com: Array) -> tuple[Array, float]:
        """Return the points (n_contacts, 3) and the feet's heading when the centre of mass is at ``com``."""
        first, last = self.stances
        if time <= self.times[0]:
            return first.points, first.heading
        if time >= self.times[1]:
            return last.points, last.heading
        duration = self.times[1] - self.times[0]
        after, before = time - self.times[0], self.times[1] - time
        x = after / duration
        share = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        lag = [-s * self._coast(t) for s, t in ((self.speed[0], after), (-self.speed[1], before))]
        offset = (1.0 - share) * (self._middle(0) + lag[0]) + share * (self._middle(1) + lag[1])
        heading = (1.0 - share) * first.heading + share * last.heading
        return com + offset + self._shape() @ _turned(heading).T, heading

    def _middle(self, which: int) -> Array:
        """Return the vector from the centre of mass to the middle of the points, on the ground."""
        return np.asarray(self.stances[which].points.mean(axis=0) - self.com[which])

    def _shape(self) -> Array:
        """Return the points from their middle, at heading zero."""
        first = self.stances[0]
        return np.asarray((first.points - first.points.mean(axis=0)) @ _turned(first.heading))

    def _coast(self, time: float) -> float:
        """Return the way of a speed of one that dies out over the blend, 1 - 3 u^2 + 2 u^3 of it."""
        u = min(time / self.blend, 1.0)
        return self.blend * (u - u**3 + 0.5 * u**4)


class WholeBodyPose:
    """Base position and joints for a centre of mass, a torso attitude and feet on given points."""

    def __init__(self, model: SymbolicModel) -> None:
        import casadi as ca

        self.model = model
        contacts = len(model.robot.contacts)
        q, com = ca.SX.sym("q", model.size), ca.SX.sym("com", 3)
        points, heading = ca.SX.sym("points", 3 * contacts), ca.SX.sym("heading")
        rows: list[Any] = [model.com(q) - com]
        along = (ca.cos(heading), ca.sin(heading))
        seen: set[str] = set()
        for j, point in enumerate(model.contact_points(q)):
            off = point - points[3 * j : 3 * j + 3]
            foot = model.robot.contacts[j].foot
            if foot not in seen:
                rows.append(along[0] * off[0] + along[1] * off[1])
            rows += [along[0] * off[1] - along[1] * off[0], off[2]]
            seen.add(foot)
        given = ca.vertcat(com, points, heading)
        error = ca.vertcat(*rows)
        self._free = [0, 1, 2, *range(6, model.size)]
        self._errors: Any = ca.Function(
            "pose", [q, given], [error, ca.jacobian(error, q), ca.jacobian(error, given)],
            {"cse": True},
        )  # fmt: skip

    def find(self, q: Array, given: Array) -> Array:
        """Return the pose near ``q`` that has its attitude.

        Raises:
            PlanError: the legs do not reach, or a joint would have to pass its limit.
        """
        q, limits = q.copy(), self.model.robot.joint_limits
        for _ in range(30):
            error, jacobian, _ = (np.array(x) for x in self._errors(q, given))
            if np.abs(error).max() < 1e-11:
                break
            step = np.linalg.lstsq(jacobian[:, self._free], -error.ravel(), rcond=None)[0]
            q[self._free] += step * min(1.0, 0.3 / np.abs(step).max())
        missed = float(np.abs(np.array(self._errors(q, given)[0])).max())
        over = np.maximum(q[6:] - limits[:, 1], limits[:, 0] - q[6:])
        if missed > 1e-8 or over.max() > 0.0:
            joint = self.model.robot.joints[int(over.argmax())]
            raise PlanError(
                "the legs cannot follow the single rigid body: "
                + (f"a foot is missed by {missed:.2g} m" if missed > 1e-8 else
                   f"{joint.name} would pass its limit by {over.max():.2g} {joint.unit('rad')}")
                + "; ask for a smaller jump, or use formulation: full",
                family="leg length", violation=max(missed, float(over.max())),
            )  # fmt: skip
        return q

    def rates(self, q: Array, turning: Array, given: Array, given_rates: Array) -> Array:
        """Return the coordinates' rates at that pose for the torso's rates of pitch, roll and yaw."""
        _, jacobian, slope = (np.array(x) for x in self._errors(q, given))
        known = jacobian[:, 3:6] @ turning + slope @ given_rates
        v = np.zeros(self.model.size)
        v[3:6] = turning
        v[self._free] = np.linalg.lstsq(jacobian[:, self._free], -known, rcond=None)[0]
        return v


def whole_body(
    model: SymbolicModel, path: FeetPath, times: Array, body: Array, rates: Array, first: Array
) -> tuple[Array, Array]:
    """Return the coordinates and rates (N, n_velocities) at the knots, beginning with the pose ``first``.

    ``body`` and ``rates`` (N, 6) are centre of mass, pitch, roll and yaw, and their derivatives.
    """
    pose, q = WholeBodyPose(model), first
    positions, velocities = [], []
    for time, place, rate in zip(times, body, rates, strict=True):

        def given(dt: float, time: float = time, place: Array = place, rate: Array = rate) -> Array:
            com = place[:3] + dt * rate[:3]
            points, heading = path.at(time + dt, com)
            return np.concatenate([com, points.ravel(), [heading]])

        q = q.copy()
        q[3:6] = place[3:]
        q = pose.find(q, given(0.0))
        flies = path.times[0] < time < path.times[1]
        slope = (given(RATE_STEP) - given(-RATE_STEP)) / (2.0 * RATE_STEP) if flies else None
        if slope is None:  # on the ground nothing moves but the centre of mass
            slope = np.zeros(len(given(0.0)))
            slope[:3] = rate[:3]
        positions.append(q)
        velocities.append(pose.rates(q, rate[3:], given(0.0), slope))
    return np.array(positions), np.array(velocities)


def _turned(heading: float) -> Array:
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rigid_body_problem(
    task: JumpTask,
    robot: RobotDescription,
    *,
    progress: Progress | None = None,
) -> tuple[SimpleProblem, RigidBody]:
    """Return the single rigid body's problem of a task, and the body.

    Raises:
        PlanError: the task asks for what the formulation has not.
    """
    model, finder = model_of(task.equipped(robot))
    functions = FunctionSet(
        stages.NAME, stages.PIECES, stages.SOURCES, lambda name: stages.make_piece(model, name)
    )
    pieces = load_functions(functions, model, progress=progress)
    stances = stances_of(task, robot, finder)
    body = composite_inertia(model.robot, stances[0])
    builder = RigidBodyProblemBuilder(task, model, pieces, body, stances[0], stances[-1])
    return builder.build(), body


def solve_rigid_body(task: JumpTask, robot: RobotDescription, options: SolveOptions) -> PlannedJump:
    """Return the plan of a task for a single rigid body; see ``solve_jump``. A ``warm_start`` is not used.

    Raises:
        PlanError: no motion was found, or the robot's legs cannot follow it.
    """
    started = cpu_time()
    if options.knots is not None:
        task = task.model_copy(update={"knots": options.knots})
    problem, body = rigid_body_problem(task, robot, progress=options.progress)
    solution = solve(problem, problem.guess, solver=options.solver)
    if not solution.solved:
        raise failure(task, solution)
    statistics = statistics_of(problem, solution)
    arrays = unpack(problem, body, solution.values, robot)
    statistics["cpu_s"] = cpu_time() - started
    return PlannedJump(task=task, statistics=statistics, versions=versions(), **arrays)


def unpack(
    problem: SimpleProblem, body: RigidBody, values: Array, robot: RobotDescription
) -> dict[str, Any]:
    """Return the arrays of a plan. The angular momentum is the rigid body's, R I w; the robot's own, which its legs
    change, follows from positions and velocities. Torques are by exact inverse dynamics.
    """
    grid, count = problem.grid, problem.knots
    states = np.array([problem.state(values, k)[:STATES] for k in range(count)])
    steps = grid.steps.copy()
    for k in grid.flight:
        steps[k] *= problem.state(values, k)[STATES]
    times = np.concatenate([[0.0], np.cumsum(steps)])
    ends = [grid.flight.start, grid.flight.stop]
    path = FeetPath(
        (problem.start, problem.end), states[ends, :3], states[ends, 6:9],
        (float(times[ends[0]]), float(times[ends[1]])),
    )  # fmt: skip
    q, v = whole_body(
        problem.model, path, times, states[:, :6], states[:, 6:], problem.start.coordinates
    )
    force = np.zeros((count, 3 * len(robot.contacts)))
    for k, phase in enumerate(grid.phases):
        if phase is not Phase.FLIGHT:
            force[k] = problem.control(values, k)[6 : 6 + force.shape[1]]
    force[-1] = force[-2]
    position = pose_of(q)
    velocity = twist_of(q, v, np.zeros_like(v))[0]
    turn = matrices_of_quaternions(position[:, 3:7])
    momentum = np.array([
        r @ body.inertia @ w for r, w in zip(turn, velocity[:, 3:6], strict=True)
    ])  # fmt: skip
    return {
        **motion_arrays(problem, steps, position, velocity, force),
        "com": states[:, :3].copy(),
        "com_velocity": states[:, 6:9].copy(),
        "angular_momentum": momentum,
        "lift_off_time": path.times[0],
        "touchdown_time": path.times[1],
    }
