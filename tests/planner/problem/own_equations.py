"""Evaluates the equations of ``paper`` and ``srbm`` with Pinocchio from a plan's arrays.

Like ``midpoint_residuals`` for ``full``, this module uses nothing of the planner's own model or solver. A plan may
fulfil all of these equations although the robot would move differently, which the other tests find.
"""

from __future__ import annotations

import numpy as np

from aloft.mathematics.arrays import Array
from aloft.mathematics.constants import GRAVITY
from aloft.mathematics.rotations import matrices_of_quaternions, multiply
from aloft.planner.models.euler_angles import ORDER, coordinates_of, rotation, twist_of
from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.planner.task.phase import Phase
from aloft.planner.task.plan import PlannedJump
from aloft.robots.description import RobotDescription

WEIGHT = np.array([0.0, 0.0, -GRAVITY])


def paper_residuals(plan: PlannedJump, dynamics: ExactDynamics) -> dict[str, float]:
    """The largest residual of each of the paper's equations in section III, over all knots.

    Units: m, rad or m/s for ``integration`` (a quaternion's components count as rad), m/s^2 for
    ``linear momentum rate``, N m s for ``angular momentum rate`` and ``h = A(q) v``, m for the
    kinematics and what is raised, N for ``friction`` and forces.
    """
    found = dict.fromkeys(
        ("integration", "linear momentum rate", "angular momentum rate", "h = A(q) v",
         "r = f_com(q)", "c = f_contact(q)", "force of a raised point", "raised points above the ground", "friction"),
        0.0,
    )  # fmt: skip

    def note(name: str, value: Array) -> None:
        found[name] = max(found[name], float(np.abs(value).max()))

    q, r, speed, h = plan.position, plan.com, plan.com_velocity, plan.angular_momentum
    places = {False: dynamics.points(q[0]), True: dynamics.points(q[-1])}
    for k in range(1, len(plan.time)):
        dt = float(plan.time[k] - plan.time[k - 1])
        landed = plan.time[k] > plan.touchdown_time - 1e-9
        v, force = plan.velocity[k], plan.contact_force[k - 1]
        turn = matrices_of_quaternions(q[k, None, 3:7])[0]
        half = 0.5 * dt * v[3:6]
        turned = np.empty(4)
        multiply(q[k - 1, 3:7], np.append(half, 1.0) / np.sqrt(1.0 + half @ half), turned)
        note("integration", q[k, :3] - q[k - 1, :3] - dt * turn @ v[:3])
        note("integration", q[k, 3:7] - turned)
        note("integration", q[k, 7:] - q[k - 1, 7:] - dt * v[6:])
        note("integration", r[k] - r[k - 1] - dt * speed[k])
        pull = (speed[k] - speed[k - 1]) / dt
        note("linear momentum rate", pull - force.sum(axis=0) / dynamics.mass - WEIGHT)
        moment = np.cross(places[landed] - r[k], force).sum(axis=0)
        note("angular momentum rate", h[k] - h[k - 1] - dt * moment)
        com, _, angular = dynamics.centroidal(q[k], v)
        note("h = A(q) v", h[k] - angular)
        note("r = f_com(q)", r[k] - com)
        held = plan.contact[k - 1] | plan.contact[k]
        if held.any():
            note("c = f_contact(q)", (dynamics.points(q[k]) - places[landed])[held])
            under = places[landed][:, 2] - dynamics.points(q[k])[:, 2]
            note("raised points above the ground", np.maximum(under, 0.0))
        note("force of a raised point", np.where(plan.contact[k - 1][:, None], 0.0, force))
        excess = np.hypot(force[:, 0], force[:, 1]) - plan.task.friction * force[:, 2]
        note("friction", np.maximum(excess, 0.0))
    return found


def rigid_body_residuals(plan: PlannedJump, dynamics: ExactDynamics) -> dict[str, float]:
    """The largest residual of each of the single rigid body's equations, over all intervals.

    Units: m, rad or their rates for ``integration``, m/s^2 for ``force balance``, N m for ``moment
    balance``, m for ``com`` and ``footholds``, which the whole body's motion must fulfil.
    """
    found = dict.fromkeys(
        ("integration", "force balance", "moment balance", "friction", "com", "footholds"), 0.0
    )

    def note(name: str, value: Array) -> None:
        found[name] = max(found[name], float(np.abs(value).max()))

    inertia = standing_inertia(plan, dynamics)
    angles, rates = (each[:, 3:6] for each in coordinates_of(plan.position, plan.velocity))
    place, rate = np.hstack([plan.com, angles]), np.hstack([plan.com_velocity, rates])
    places = {False: dynamics.points(plan.position[0]), True: dynamics.points(plan.position[-1])}
    for k in range(len(plan.time) - 1):
        h = float(plan.time[k + 1] - plan.time[k])
        force, bend = plan.contact_force[k], (rate[k + 1] - rate[k]) / h
        note("integration", place[k + 1] - place[k] - 0.5 * h * (rate[k] + rate[k + 1]))
        middle = place[k] + 0.5 * h * rate[k] + 0.125 * h * h * bend
        moving = rate[k] + 0.5 * h * bend
        note("force balance", bend[:3] - force.sum(axis=0) / dynamics.mass - WEIGHT)
        spin, spun = (each[3:] for each in twist_of(middle, moving, bend))
        turn = rotation(middle[3:][ORDER])
        landed = plan.time[k] > plan.touchdown_time - 1e-9
        moment = np.cross(places[landed] - middle[:3], force).sum(axis=0)
        note("moment balance", turn @ (inertia @ spun + np.cross(spin, inertia @ spin)) - moment)
        excess = np.hypot(force[:, 0], force[:, 1]) - plan.task.friction * force[:, 2]
        note("friction", np.maximum(excess, 0.0))
        note("com", plan.com[k] - dynamics.centroidal(plan.position[k], plan.velocity[k])[0])
        if plan.phase[k] != Phase.FLIGHT:
            note("footholds", dynamics.points(plan.position[k]) - places[landed])
    return found


def standing_inertia(plan: PlannedJump, dynamics: ExactDynamics) -> Array:
    """The robot's inertia about its centre of mass in its first pose, torso axes (3, 3)."""
    pin, q = dynamics.pin, plan.position[0]
    pin.ccrba(dynamics.model, dynamics.data, q, np.zeros(dynamics.model.nv))
    turn = matrices_of_quaternions(q[None, 3:7])[0]
    return np.asarray(turn.T @ np.array(dynamics.data.Ig.inertia) @ turn)


def unmodelled_momentum(plan: PlannedJump, dynamics: ExactDynamics) -> Array:
    """The angular momentum [N m s] of the robot minus that in the plan, (N, 3)."""
    exact = [
        dynamics.centroidal(q, v)[2] for q, v in zip(plan.position, plan.velocity, strict=True)
    ]
    return np.array(exact) - plan.angular_momentum


def own_residuals(plan: PlannedJump, robot: RobotDescription) -> dict[str, float]:
    """The residuals of the plan's formulation; none for ``full``, which ``midpoint_residuals`` has."""
    evaluate = RESIDUALS.get(plan.task.formulation)
    return evaluate(plan, ExactDynamics(plan.task.equipped(robot))) if evaluate else {}


RESIDUALS = {"paper": paper_residuals, "srbm": rigid_body_residuals}
"""By formulation."""
