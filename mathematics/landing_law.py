"""Landing places of feet after a flight: the landing law of the paper (IV), and the turning of the
body while the legs move.

Without contact the angular momentum k about the centre of mass c is constant, so whatever the legs
do the body turns against it. With the base's angular velocity w in its own axes, joint velocities
q', and the centroidal momentum matrix A,

    k = A_kw w + A_kq q'          so  w = W k - B q',               W = A_kw^-1, B = W A_kq
    p_i' - c' = D_i w + E_i q'    so  p_i' - c' = D_i W k + G_i q',  G_i = E_i - D_i B

where p_i is a contact point, D_i = J_i,w - A_lw / m and E_i = J_i,q - A_lq / m. G is the
generalised Jacobian of robots that float in space. It gives the joint motion that moves the feet
where they should go, and thus how far the base turns on the way. BRUCE's legs are two thirds of its
mass: feet that keep their place in the world move by 33 mm in the base for every 0.1 rad that the
base turns, and that turns it by 0.07 rad more.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .arrays import Array1D, Array2D, Array3D, Matrix3, Rows3, Vector2, Vector3, Vector4
from .elementary import sincos
from .kernel import kernel
from .linear_algebra import multiply_matrices, solve_positive, solve_rows


@kernel
def landing_position(
    nominal: Array1D,
    side: float,
    linear: Array1D,
    angular: Array1D,
    w_l: Array1D,
    w_k: Array1D,
    w_c: float,
    p_max: Array1D,
    centre: Array1D,
    out: Array1D,
) -> None:
    """Apply the paper's law (IV): the landing place (3,) from the nominal one (3,); z is unchanged.

    Args:
        side: 1 for a foot on the left, -1 on the right, 0 in the middle.
        linear, angular: the momenta l and k fed back.
        p_max: the largest distance of the place from ``centre`` (3,), ahead and aside [m].
    """
    x = nominal[0] + w_l[0] * linear[0] + w_k[0] * angular[1]
    y = nominal[1] + w_l[1] * linear[1] + w_k[1] * angular[0]
    y += side * w_c * abs(linear[1])
    out[0], out[1], out[2] = x, y, nominal[2]
    keep_within(p_max, centre, centre, out)


@kernel
def keep_within(p_max: Vector2, centre: Array1D, planned: Array1D, place: Array1D) -> None:
    """Move a ``place`` (3,) that is farther from the ``centre`` than ``p_max`` ahead or aside, and than the ``planned``
    place on the same side, to the farther of these limits: the plan has tried what it asks for."""
    for i in range(2):
        far = p_max[i]
        distance, reach = place[i] - centre[i], planned[i] - centre[i]
        if distance * reach > 0.0:
            far = max(far, abs(reach))
        if abs(distance) > far:
            place[i] = centre[i] + math.copysign(far, distance)


@kernel
def pull_to_position(goal: Array1D, miss: Array1D, gain: float, width: float) -> None:
    """Move the landing place with regard to balance towards the planned place in the world.

    The way from the planned place to the ``goal`` is d = goal + miss. Of this way the share
    gain / (1 + (|d| / width)^4) is taken back: nearly ``gain`` of a way that the standing feet can
    balance, and next to nothing where the robot would fall.

    Args:
        goal: the shift of the feet ahead and to the left [m], (2 or more,), which is changed.
        miss: the distance of the feet from their planned place without a shift [m], (2 or more,).
        width: the length of d at which half of ``gain`` is left [m].
    """
    x, y = goal[0] + miss[0], goal[1] + miss[1]
    far = (x * x + y * y) / (width * width)
    share = gain / (1.0 + far * far)
    goal[0] -= share * x
    goal[1] -= share * y


@kernel
def turn_places(places: Array2D, angle: float, out: Array2D) -> None:
    """Rotate places (n, 3) about the vertical by ``angle`` [rad]."""
    sine, cosine = sincos(angle)
    for i in range(places.shape[0]):
        x, y = places[i, 0], places[i, 1]
        out[i, 0], out[i, 1], out[i, 2] = cosine * x - sine * y, sine * x + cosine * y, places[i, 2]


@kernel
def lowest_height(points: Array2D) -> float:
    """Return the least z of points (n, 3)."""
    lowest = points[0, 2]
    for i in range(1, points.shape[0]):
        lowest = min(lowest, points[i, 2])
    return float(lowest)


@kernel
def swing(
    planned: Vector3,
    place: Vector3,
    offset: Vector3,
    share: float,
    rate: float,
    out: Vector3,
    speed: Vector3,
) -> None:
    """Compute the motion of a foot from its offset at lift-off to its corrected landing place.

    Args:
        planned, place: the positions relative to the centre of mass [m, world] without and with the
            correction, (3,).
        offset: the measured minus the planned position at lift-off [m, world], (3,).
        share, rate: the share of the way, from 0 to 1, and its time derivative [1/s].
        out: becomes the foot's position.
        speed: the planned velocity [m/s], which becomes the foot's.
    """
    for k in range(3):
        goal = place[k] - planned[k]
        start = offset[k]
        out[k] = planned[k] + start + share * (goal - start)
        speed[k] += rate * (goal - start)


@kernel
def apply_lead(
    swing_velocity: Array1D, lead: float, rate: float, place: Array1D, speed: Array1D
) -> None:
    """Bring a foot forward on its planned way by the time ``lead``, ahead and aside.

    Args:
        swing_velocity: planned, of the foot as seen from the centre of mass [m/s, world], (3,).
        lead, rate: how far ahead of the plan the foot should be [s], and the derivative of that.
        place, speed: the foot's position from the centre of mass [m] and its velocity [m/s], (3,),
            which are changed.
    """
    for k in range(2):
        place[k] += lead * swing_velocity[k]
        speed[k] += rate * swing_velocity[k]


@kernel
def retraction(left: float, speed: float, duration: float) -> tuple[float, float]:
    """Height added to the foot and its rate, ``left`` seconds before touchdown.

    It first reaches down, then comes up, so that at touchdown it is zero and its rate ``speed``.
    """
    x = min(max(left / duration, 0.0), 1.0)
    return -speed * duration * x * (1.0 - x) ** 2, speed * (1.0 - x) * (1.0 - 3.0 * x)


@kernel
def heading_matrix(angle: float, out: Array2D) -> None:
    """Compute the rotation about the vertical by ``angle`` [rad], (3, 3)."""
    sine, cosine = sincos(angle)
    out[:, :] = 0.0
    out[0, 0] = out[1, 1] = cosine
    out[0, 1], out[1, 0], out[2, 2] = -sine, sine, 1.0


_HELD = 1e6
"""The weight of a shift in height that is held at its bound; the others' weights are near one."""


class FlightMap(NamedTuple):
    """Map from the motion of the legs to the turning of the base, with its scratch memory.

    Attributes:
        drift: the base's angular velocity in world axes per angular momentum with the joints
            still, (3, 3).
        carried: the velocity that the contact points then have, (3 n_contacts, 3).
        turn: the base's rotation about the world's x and y axes [rad] per displacement of the
            contact points as seen from the centre of mass [m], (2, 3 n_contacts).
        jacobian, inverse, reaction: G, W and B.
        normal, lever: scratch of shapes (n_joints, n_joints) and (3, 3).
        answers: scratch, (2, n_joints).
    """

    drift: Matrix3
    carried: Rows3
    turn: Array2D
    jacobian: Array2D
    inverse: Matrix3
    reaction: Array2D
    normal: Array2D
    lever: Matrix3
    answers: Array2D


def flight_map(n_joints: int, n_contacts: int) -> FlightMap:
    """Allocate the memory for ``map_flight``."""
    rows = 3 * n_contacts
    return FlightMap(
        drift=np.zeros((3, 3)),
        carried=np.zeros((rows, 3)),
        turn=np.zeros((2, rows)),
        jacobian=np.zeros((rows, n_joints)),
        inverse=np.zeros((3, 3)),
        reaction=np.zeros((3, n_joints)),
        normal=np.zeros((n_joints, n_joints)),
        lever=np.zeros((3, 3)),
        answers=np.zeros((2, n_joints)),
    )


@kernel
def map_flight(
    momentum: Array2D,
    jacobian: Array3D,
    rotation: Matrix3,
    mass: float,
    damping: float,
    out: FlightMap,
) -> None:
    """Compute ``out`` for the present configuration.

    Args:
        momentum: the centroidal momentum matrix A, (6, 6 + n_joints), linear rows first.
        jacobian: of the contact points, (n_contacts, 3, 6 + n_joints).
        rotation: from the base to the world, (3, 3).
        mass: of the robot [kg].
        damping: of the joint motion where a leg is nearly stretched [m].
    """
    n = out.reaction.shape[1]
    invert(momentum[3:6, 3:6], out.inverse)
    multiply_matrices(out.inverse, momentum[3:6, 6:], out.reaction)
    multiply_matrices(rotation, out.inverse, out.drift)
    for i in range(jacobian.shape[0]):
        for j in range(3):
            out.lever[j, :] = jacobian[i, j, 3:6] - momentum[j, 3:6] / mass
        rows = out.jacobian[3 * i : 3 * i + 3]
        multiply_matrices(out.lever, out.inverse, out.carried[3 * i : 3 * i + 3])
        multiply_matrices(out.lever, out.reaction, rows)
        for j in range(3):
            for k in range(n):
                along = jacobian[i, j, 6 + k] - momentum[j, 6 + k] / mass
                rows[j, k] = along - rows[j, k]
    multiply_matrices(out.jacobian.T, out.jacobian, out.normal)
    for k in range(n):
        out.normal[k, k] += damping * damping
    multiply_matrices(rotation[0:2], out.reaction, out.answers)
    solve_rows(out.normal, out.answers)
    multiply_matrices(out.answers, out.jacobian.T, out.turn)
    for i in range(2):
        out.turn[i, :] = -out.turn[i]


@kernel
def predict_tilt(
    flight: FlightMap,
    tilt: Vector3,
    momentum: Vector3,
    way: Array1D,
    time: float,
    later: float,
    side: Array1D,
    goal: Vector2,
    turn: Array2D,
) -> None:
    """Predict the base's tilt at touchdown, and how shifts of the landing place change it.

    Args:
        tilt: the base's rotation from the planned orientation now, in world axes [rad], (3,).
        momentum: the angular momentum that was not planned, (3,).
        way: how far the contact points still have to go to their planned places, as seen from the
            centre of mass [m], (3 n_contacts,).
        time: left until touchdown without a shift [s].
        later: delay of touchdown per shift of the feet upwards [s/m].
        side: 1 for contact points of a left foot, -1 of a right one, 0 in the middle,
            (n_contacts,). goal: becomes the rotation about x and y at touchdown if the feet land as
            planned, (2,). turn: becomes its change [rad/m] per shift of the feet ahead, to the
            left, apart and
            upwards, (2, 4).
    """
    for j in range(2):
        value, rate = tilt[j], 0.0
        for k in range(3):
            rate += flight.drift[j, k] * momentum[k]
        turn[j, :] = 0.0
        for i in range(way.shape[0]):
            carried = 0.0
            for k in range(3):
                carried += flight.carried[i, k] * momentum[k]
            per_way = flight.turn[j, i]
            value += per_way * way[i]
            rate -= per_way * carried
            if i % 3 == 2:
                turn[j, 3] += per_way
            else:
                turn[j, i % 3] += per_way
            if i % 3 == 1:
                turn[j, 2] += side[i // 3] * per_way
        goal[j] = value + time * rate
        turn[j, 3] += later * rate


class LandingCost(NamedTuple):
    """Weights and bounds of the choice of the landing place.

    Attributes:
        goal: the shifts that are best for the momenta: ahead, to the left, apart [m], (3,).
        weight: of deviations from these three and of the shift in height, without unit, and of the
            tilt about x and y [m^2/rad^2], (6,).
        free: the lowest and highest tilt about x and y that costs nothing [rad], (2, 2).
        bounds: lowest and highest shift in height [m], (2,).
    """

    goal: Vector3
    weight: Array1D
    free: Array2D
    bounds: Vector2


@kernel
def choose_shift(
    tilt: Vector2, turn: Array2D, cost: LandingCost, matrix: Array2D, shift: Vector4
) -> None:
    """Choose the ``shift`` (4,) of the feet ahead, to the left, apart and upwards [m] that costs
    least::

        sum_i weight_i (shift_i - goal_i)^2 + weight_3 shift_3^2
            + sum_j weight_(4+j) (tilt_j + turn_j shift - free_j)^2   with shift_3 within the bounds

    free_j is the nearest tilt that costs nothing: within ``free`` the one that the goal leads to
    anyway, and beyond it the bound.

    Args:
        tilt, turn: see ``predict_tilt``.
        matrix: scratch, (4, 4).
    """
    bound = 0.0
    for attempt in range(2):
        matrix[:, :] = 0.0
        for i in range(4):
            weight, goal = cost.weight[i], bound
            if i < 3:
                goal = cost.goal[i]
            elif attempt == 1:
                weight = _HELD
            matrix[i, i] = weight
            shift[i] = weight * goal
        for j in range(2):
            aimed = tilt[j]
            for i in range(3):
                aimed += turn[j, i] * cost.goal[i]
            free = min(max(aimed, cost.free[j, 0]), cost.free[j, 1])
            weight = cost.weight[4 + j] if aimed != free else 0.0
            for i in range(4):
                part = weight * turn[j, i]
                shift[i] -= part * (tilt[j] - free)
                for k in range(4):
                    matrix[i, k] += part * turn[j, k]
        solve_positive(matrix, shift)
        bound = min(max(shift[3], cost.bounds[0]), cost.bounds[1])
        if bound == shift[3]:
            return


@kernel
def invert(matrix: Matrix3, out: Matrix3) -> None:
    """Invert a regular matrix (3, 3), by its cofactors; zero for a singular one."""
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            c, d = (j + 1) % 3, (j + 2) % 3
            first = matrix[a, c] * matrix[b, d]
            out[j, i] = first - matrix[a, d] * matrix[b, c]
    determinant = 0.0
    for j in range(3):
        determinant += matrix[0, j] * out[j, 0]
    scale = 1.0 / determinant if abs(determinant) > 1e-300 else 0.0
    for i in range(3):
        out[i, :] *= scale
