"""Whether a simulated robot stands, once it has settled, as its description says it does."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...mathematics.constants import GRAVITY
from ...mathematics.support_margin import support_margin
from ...robots.description import RobotDescription
from .base import FixedBase
from .stance import StartError

if TYPE_CHECKING:
    from mujoco import MjData, MjModel

Array = NDArray[np.float64]

LOAD_ERROR = 0.05
"""By what share the feet's mean load may differ from the robot's weight."""
MOST_JOINT_SPEED = 0.2
"""What a joint may still move at [rad/s, or m/s for a slide]."""
MOST_BASE_SPEED = 0.03
"""What the base may still move at [m/s]."""
MOST_BASE_RATE = 0.1
"""What the base may still turn at [rad/s]."""
MOST_TILT_ERROR = 0.03
"""By how much the base may be turned otherwise than asked for [rad]."""
MOST_SAG = 0.02
"""By how much a held joint may be away from where it is held [rad, or m for a slide]."""
NEAR = 0.001
"""A contact point higher above the ground than this is in the air [m]."""


MOST_NAMED = 3
"""How many joints, links or contact points of a kind an error names."""


class StartCheck:
    """Checks that a settled robot stands: its feet carry its weight, nothing else touches anything,
    nothing moves, and the base is turned as asked for.

    A robot on a fixed base, or without contact points, is only asked to be still when it is held.

    Args:
        model, data: the simulator's, after settling.
        base: how the robot's base is held.
        robot: its description.
    """

    def __init__(
        self, model: MjModel, data: MjData, base: FixedBase, robot: RobotDescription
    ) -> None:
        self._model, self._data, self._base, self._robot = model, data, base, robot
        self._standing = bool(robot.contacts) and base.velocities > 0

    def check(self, load: Array, wanted: Array, torque: Array, rotation: Array) -> None:
        """Raise ``StartError`` with what keeps the robot from standing, or where no cause is found
        with what shows that it does not stand.

        Args:
            load: the mean vertical force on every contact point [N], (n_contacts,).
            wanted: the joint positions in which the drives hold the robot [rad], (n_joints,).
            torque: that hold it there without moving [N m], (n_joints,).
            rotation: the matrix (3, 3) from base to world that the robot was placed with.
        """
        symptoms = [*self._sagging(wanted), *self._moving()]
        if self._standing:
            symptoms = [*self._unloaded(load), *symptoms, *self._tilted(rotation)]
        causes = [*self._unbalanced(), *self._touching()] if self._standing else []
        if symptoms:
            causes += self._too_weak(torque)
        found = causes or symptoms
        if not found:
            return
        verb = "stand" if self._standing else "stay"
        raise StartError(
            f"{self._robot.name} does not {verb} as its description says when it is held in its "
            f"standing pose for 0.3 s: {'; '.join(found)}"
        )

    def _unbalanced(self) -> list[str]:
        """The centre of mass outside the support."""
        places = np.array([self._data.site(c.name).xpos for c in self._robot.contacts])
        com = self._data.sensor("com").data
        loaded = np.ones(len(places), dtype=np.bool_)
        margin = support_margin(places, loaded, float(com[0]), float(com[1]))
        if self._base.velocities == 3:  # it cannot fall sideways
            x, ahead = float(com[0]), places[:, 0]
            margin = min(x - float(ahead.min()), float(ahead.max()) - x)
        if margin > 0.0:
            return []
        way = _millimetres(-margin)
        return [f"its centre of mass is {way} outside its contact points, so it tips over"]

    def _touching(self) -> list[str]:
        """Links that touch something, and points that touch something else than the ground."""
        model, contacts = self._model, [contact.name for contact in self._robot.contacts]
        found: dict[str, None] = {}
        for first, second in self._data.contact.geom.tolist():
            names = [model.geom(geom).name for geom in (first, second)]
            bodies = [int(model.geom_bodyid[geom]) for geom in (first, second)]
            grounded = 0 in bodies
            owner = names[1] if bodies[0] == 0 else names[0]
            if grounded and owner in contacts:
                continue
            links = [model.body(body).name for body in bodies if body]
            if grounded:
                found[f"link {links[0]} touches the ground"] = None
            else:
                found[f"links {links[0]} and {links[1]} touch each other"] = None
        return _some(list(found))

    def _too_weak(self, torque: Array) -> list[str]:
        """Motors that cannot produce what holds the robot; joints without motors are not held."""
        robot = self._robot
        needed = np.abs(robot.torque_to_motor @ torque)
        found = []
        for k, peak in enumerate(robot.motors.peak_torque.tolist()):
            if peak > 0.0 and float(needed[k]) > peak:
                name, wanted = robot.transmission.motors[k], float(needed[k])
                found.append(f"motor {name} has {peak:.3g} N m and would need {wanted:.3g} N m")
        return _some(found)

    def _unloaded(self, load: Array) -> list[str]:
        """Feet in the air, and a weight that they do not carry."""
        total = float(load.sum())
        weight = float(self._model.body_subtreemass[0]) * GRAVITY
        if abs(total - weight) <= LOAD_ERROR * weight:
            return []
        carried = f"its contact points carry {total:.3g} N of its weight of {weight:.3g} N"
        found = []
        for contact in self._robot.contacts:
            ball = self._data.geom(contact.name)
            height = ball.xpos.item(2) - contact.radius
            if height > NEAR:
                found.append(f"{contact.name} is {_millimetres(height)} above the ground")
        return [carried, *_some(found)]

    def _sagging(self, wanted: Array) -> list[str]:
        """Joints that are not where they are held, the worst first."""
        away = self._data.qpos[self._base.positions :] - wanted
        text = "joint {name} is {value:+.2g} {unit} from where it is held"
        return self._joints(away, MOST_SAG, text, "rad", "m")

    def _moving(self) -> list[str]:
        """What still moves, the worst joints first."""
        speeds = self._data.qvel[self._base.velocities :]
        text = "joint {name} moves at {value:.2g} {unit}"
        found = self._joints(speeds, MOST_JOINT_SPEED, text, "rad/s", "m/s")
        size = self._base.velocities
        linear = math.hypot(*self._data.qvel[: min(size, 2) if size == 3 else min(size, 3)])
        self._base.refresh()
        turning = math.hypot(*self._base.angular_velocity)
        if not linear <= MOST_BASE_SPEED:
            found.append(f"its base moves at {linear:.2g} m/s")
        if not turning <= MOST_BASE_RATE:
            found.append(f"its base turns at {turning:.2g} rad/s")
        return found

    def _joints(self, values: Array, most: float, text: str, hinge: str, slide: str) -> list[str]:
        """What ``text`` says of every joint whose value is more than ``most``, the worst first."""
        worst = sorted(range(len(values)), key=lambda k: -abs(values.item(k)))
        found = []
        for k in worst:
            joint, value = self._robot.joints[k], values.item(k)
            unit = slide if joint.kind == "slide" else hinge
            if not abs(value) <= most:
                found.append(text.format(name=joint.name, value=value, unit=unit))
        return _some(found)

    def _tilted(self, rotation: Array) -> list[str]:
        """A base that has turned from where it was put."""
        import mujoco

        turned = self._data.body(1).xmat.reshape(3, 3)
        cosine = 0.0
        for k in range(3):
            cosine += mujoco.mju_dot3(turned[k], rotation[k])
        angle = math.acos(min(1.0, max(-1.0, 0.5 * (cosine - 1.0))))
        if angle <= MOST_TILT_ERROR:
            return []
        return [f"its base has turned by {math.degrees(angle):.2g} deg from its standing pose"]


def _some(found: list[str]) -> list[str]:
    """The first few, and how many there are besides."""
    more = len(found) - MOST_NAMED
    return found if more <= 0 else [*found[:MOST_NAMED], f"the same of {more} more"]


def _millimetres(length: float) -> str:
    return f"{1e3 * length:.2g} mm" if length < 0.01 else f"{1e3 * length:.0f} mm"
