"""The pieces of a jump of a single rigid body: constant inertia, legs without mass.

The body's centre of mass is the robot's, its inertia that of the whole robot as it stands, and its
frame the torso's. With r the centre of mass and e the Euler angles pitch, roll, yaw of the torso:

``stance``  z = r, e, rdot, edot, a, F.     Rows: gap (12), force (3) and moment balance (3), friction
            pyramid (4 a contact point).
``flight``  z = r, e, rdot, edot, h, a.     Interval of ``share`` h seconds. Rows: gap (13), balances.
``legs``    z = r, e.                       Rows: squared length of every leg from hip to ankle.
``take_off`` z = r, rdot.                   Rows: apex height, vertical speed.

Over an interval the six accelerations a are constant and the balances, Newton's and Euler's, hold in
its middle: m (a + g) = sum F and R (I wdot + w x I w) = sum (c - r) x F.
"""

from __future__ import annotations

from typing import Any

from ...mathematics.constants import GRAVITY
from ..models.symbolic_frames import base_angular_acceleration, base_angular_velocity, base_rotation
from ..models.symbolic_model import SymbolicModel
from .stage_functions import Piece, derived

NAME = "srbm"
PIECES = ("stance", "flight", "legs", "take_off")
SOURCES = (
    "models/symbolic_frames.py",
    "models/symbolic_model.py",
    "problem/stage_functions.py",
    "problem/rigid_body_stages.py",
)


def parameter_sizes(model: SymbolicModel) -> dict[str, dict[str, int]]:
    """The parameters ``w`` of every piece: name -> size, in order."""
    contacts, legs = len(model.robot.contacts), len(model.limbs)
    weights = {"nominal": 3, "orientation": 1, "rates": 1, "acceleration": 1}
    return {
        "stance": {"step": 1, "inertia": 9, **weights, "force": 1, "friction": 1,
                   "place": 3 * contacts},
        "flight": {"share": 1, "inertia": 9, **weights},
        "legs": {"hip": 3 * legs, "ankle": 3 * legs},
        "take_off": {},
    }  # fmt: skip


def make_piece(model: SymbolicModel, name: str) -> Piece:
    """The functions of a piece with exact derivatives."""
    import casadi as ca

    w = {key: ca.SX.sym(key, size) for key, size in parameter_sizes(model)[name].items()}
    cost: Any = ca.SX(0)
    if name == "legs":
        z = ca.SX.sym("z", 6)
        turn = base_rotation(z[3:])
        hips, ankles = (ca.reshape(w[key], 3, -1) for key in ("hip", "ankle"))
        reach = [z[:3] + ca.mtimes(turn, hips[:, i]) - ankles[:, i] for i in range(hips.size2())]
        rows = ca.vertcat(*(ca.dot(leg, leg) for leg in reach))
    elif name == "take_off":
        z = ca.SX.sym("z", 6)
        rows = ca.vertcat(z[2] + z[5] ** 2 / (2.0 * GRAVITY), z[5])
    else:
        z, cost, rows = _interval(model, name, w)
    return derived(f"{NAME}_{name}", z, ca.vertcat(*w.values()), cost, rows)


def _interval(model: SymbolicModel, name: str, w: Any) -> tuple[Any, Any, Any]:
    import casadi as ca

    flies = name == "flight"
    place, rate, a = (ca.SX.sym(s, 6) for s in ("place", "rate", "a"))
    length = ca.SX.sym("h")
    F = ca.SX.sym("F", 0 if flies else 3 * len(model.robot.contacts))
    h = w["share"] * length if flies else w["step"]
    middle = place + 0.5 * h * rate + 0.125 * h * h * a
    moving = rate + 0.5 * h * a
    forces = [F[3 * j : 3 * j + 3] for j in range(F.numel() // 3)]
    pushed: Any = ca.SX.zeros(3)
    turned: Any = ca.SX.zeros(3)
    cones = []
    for j, force in enumerate(forces):
        pushed = pushed + force
        turned = turned + ca.cross(w["place"][3 * j : 3 * j + 3] - middle[:3], force)
        reach = w["friction"] * force[2]
        cones += [reach - force[0], reach + force[0], reach - force[1], reach + force[1]]
    inertia = ca.reshape(w["inertia"], 3, 3)
    spin = base_angular_velocity(middle[3:], moving[3:])
    spun = base_angular_acceleration(middle[3:], moving[3:], a[3:])
    moment = ca.mtimes(inertia, spun) + ca.cross(spin, ca.mtimes(inertia, spin))
    balance = a[:3] + ca.DM([0.0, 0.0, GRAVITY]) - pushed / model.robot.total_mass
    gap = [-(place + h * rate + 0.5 * h * h * a), -(rate + h * a), *([-length] if flies else [])]
    off = place[3:] - w["nominal"]
    cost = (
        w["orientation"] * ca.dot(off, off)
        + w["rates"] * ca.dot(rate[3:], rate[3:])
        + w["acceleration"] * ca.dot(a, a)
    )
    if forces:
        cost = cost + w["force"] * ca.dot(F, F)
    turn = base_rotation(middle[3:])
    rows = ca.vertcat(*gap, balance, ca.mtimes(turn, moment) - turned, *cones)
    z = ca.vertcat(place, rate, length, a) if flies else ca.vertcat(place, rate, a, F)
    return z, h * cost, rows
