"""The pieces of the paper's jump problem (section III): centroidal momentum and kinematics.

The variables are the paper's: at knot k positions q[k] (7 + n, with a quaternion), velocities v[k]
(6 + n), centre of mass r[k], rdot[k], rddot[k], contact forces F_j[k] and angular momentum h[k].
Its integration, "[k] - [k-1] = rate[k] dt", makes q, r, rdot, h the states of a knot and v, rddot, F
of the *next* knot its controls: every equation of knot k + 1 is written here in x = (q, r, rdot,
h)[k] and u = (v, rddot, F)[k+1], with what the integration leads to in place of (q, r, rdot, h)[k+1].
The solutions are the same, and the problem has the order in time that fatrop wants.

``stance``   z = x, u.  Rows: integration of q, r, rdot, h; linear momentum rate (3), momentum h =
             A(q) v (3), friction cone (a row a contact point).
``flight``   the same without F.
``posture``  z = x.     Rows: r - f_com(q) (3), f_contact(q) - c (5 a line foot).
``attitude`` z = quaternion.  Rows: the turn from the wanted one (3).
"""

from __future__ import annotations

from typing import Any

from ...mathematics.constants import GRAVITY
from ..models import centroidal_model as centroidal
from ..models.symbolic_model import SymbolicModel
from .stage_functions import Piece, derived

NAME = "paper"
PIECES = ("stance", "flight", "posture", "attitude")
TIP = 1e-2
"""N, how far the friction cone's tip is rounded, inwards, to be smooth where there is no force."""
SOURCES = (
    "models/symbolic_frames.py",
    "models/symbolic_model.py",
    "problem/stage_functions.py",
    "models/centroidal_model.py",
    "problem/centroidal_stages.py",
)


def state_size(model: SymbolicModel) -> int:
    """The numbers in q, r, rdot and h."""
    return model.size + 1 + 9


def parameter_sizes(model: SymbolicModel) -> dict[str, dict[str, int]]:
    """The parameters ``w`` of every piece: name -> size, in order. ``Q_q``, ``Q_v``, ``Q_h`` and
    ``Q_f`` are the diagonals of the cost's weights, ``q_nom`` its nominal position."""
    contacts = len(model.robot.contacts)
    weights = {"q_nom": model.size + 1, "Q_q": model.size + 1, "Q_v": model.size, "Q_h": 1}
    return {
        "stance": {"step": 1, **weights, "Q_f": 1, "friction": 1, "place": 3 * contacts},
        "flight": {"step": 1, **weights},
        "posture": {"place": 3 * contacts, "heading": 2},
        "attitude": {"wanted": 4},
    }


def make_piece(model: SymbolicModel, name: str) -> Piece:
    """The functions of a piece with exact derivatives."""
    import casadi as ca

    w = {key: ca.SX.sym(key, size) for key, size in parameter_sizes(model)[name].items()}
    if name == "attitude":
        z = ca.SX.sym("quaternion", 4)
        cost, rows = _attitude(z, w)
    elif name == "posture":
        z = ca.SX.sym("x", state_size(model))
        cost, rows = _posture(model, z, w)
    else:
        x, v, pull = (
            ca.SX.sym("x", state_size(model)), ca.SX.sym("v", model.size), ca.SX.sym("rddot", 3)
        )  # fmt: skip
        F = ca.SX.sym("F", 3 * len(model.robot.contacts) if name == "stance" else 0)
        z = ca.vertcat(x, v, pull, F)
        cost, rows = _interval(model, x, v, pull, F, w)
    return derived(f"{NAME}_{name}", z, ca.vertcat(*w.values()), cost, rows)


def _interval(model: SymbolicModel, x: Any, v: Any, pull: Any, F: Any, w: Any) -> tuple[Any, Any]:
    """Knot k + 1: the integration, momentum rates and the friction cone, and its cost."""
    import casadi as ca

    n, dt, mass = model.size + 1, w["step"], model.robot.total_mass
    q, r, speed, h = x[:n], x[n : n + 3], x[n + 3 : n + 6], x[n + 6 :]
    forces = [F[3 * j : 3 * j + 3] for j in range(F.numel() // 3)]
    # Integration of q, rdot and r.
    later = ca.vertcat(
        q[:3] + dt * v[:3],
        centroidal.quaternion_step(q[centroidal.QUATERNION], v[3:6], dt),
        q[7:] + dt * v[6:],
    )
    speed_later = speed + dt * pull
    r_later = r + dt * speed_later
    # Angular momentum rate, and the integration of h.
    rate: Any = ca.SX.zeros(3)
    for j, force in enumerate(forces):
        rate = rate + ca.cross(w["place"][3 * j : 3 * j + 3] - r_later, force)
    h_later = h + dt * rate
    # Linear momentum rate, in units of acceleration; h = A(q) v; the cone.
    weight = ca.DM([0.0, 0.0, GRAVITY])
    balance = pull + weight - (sum(forces) / mass if forces else 0)
    tie = h_later - centroidal.angular_momentum(model, later, v)
    cones = [
        w["friction"] * force[2] - ca.sqrt(force[0] ** 2 + force[1] ** 2 + TIP**2)
        for force in forces
    ]
    off = later - w["q_nom"]
    cost = (
        ca.dot(w["Q_q"], off * off)
        + ca.dot(w["Q_v"], v * v)
        + ca.dot(pull, pull)
        + w["Q_h"] * ca.dot(rate, rate)
    )
    if forces:
        cost = cost + w["Q_f"] * ca.dot(F, F)
    gap = -ca.vertcat(later, r_later, speed_later, h_later)
    return dt * cost, ca.vertcat(gap, balance, tie, *cones)


def _posture(model: SymbolicModel, x: Any, w: Any) -> tuple[Any, Any]:
    """The centre of mass and the contact points are those of the position."""
    import casadi as ca

    n = model.size + 1
    q, heading = x[:n], w["heading"]
    rows, seen = [x[n : n + 3] - centroidal.com(model, q)], set()
    for j, point in enumerate(centroidal.contact_points(model, q)):
        off = point - w["place"][3 * j : 3 * j + 3]
        along = heading[0] * off[0] + heading[1] * off[1]
        across = heading[0] * off[1] - heading[1] * off[0]
        foot = model.robot.contacts[j].foot
        # The two points of a line foot have a fixed distance: one "along" says it all.
        rows += [across, off[2]] if foot in seen else [along, across, off[2]]
        seen.add(foot)
    return ca.SX(0), ca.vertcat(*rows)


def _attitude(q: Any, w: Any) -> tuple[Any, Any]:
    """Half the sine of the turn that is missing."""
    import casadi as ca

    back = ca.vertcat(-w["wanted"][:3], w["wanted"][3])
    return ca.SX(0), centroidal.quaternion_product(back, q)[:3]
