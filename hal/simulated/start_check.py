"""The check that a simulated robot which has settled stands as its description says."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.capture_step import support_margin
from ...mathematics.constants import GRAVITY
from ...mathematics.elementary import acos
from ...mathematics.linear_algebra import product
from ...robots.description import RobotDescription
from .base import FixedBase
from .stance import StartError

if TYPE_CHECKING:
    from mujoco import MjData, MjModel

LOAD_ERROR = 0.05
"""The largest difference of the feet's mean load from the robot's weight, as a share of it."""
MOST_JOINT_SPEED = 0.2
"""The largest speed of a joint that counts as still [rad/s, or m/s for a slide]."""
MOST_BASE_SPEED = 0.03
"""The largest speed of a base that counts as still [m/s]."""
MOST_BASE_RATE = 0.1
"""The largest angular speed of a base that counts as still [rad/s]."""
MOST_TILT_ERROR = 0.03
"""The largest angle between the base's orientation and the one asked for [rad]."""
MOST_SAG = 0.02
"""The largest error of a held joint's position [rad, or m for a slide]."""
NEAR = 0.001
"""A contact point higher above the ground than this is in the air [m]."""
MOST_NAMED = 3
"""Largest number of joints, links or contact points of a kind that an error names."""


class StartCheck:
    """Checks that a settled robot stands: its feet carry its weight, nothing else touches anything,
    nothing moves, and the base has the orientation asked for.

    A robot on a fixed base must only be still while it is held; a free one without feet need not.

    Args:
        model, data: the simulator's model and data, after settling.
        base: how the robot's base is held.
        robot: its description.
        hangs: whether a gantry carries it, in which it may swing.
    """

    def __init__(
        self, model: MjModel, data: MjData, base: FixedBase, robot: RobotDescription,
        hangs: bool = False,
    ) -> None:  # fmt: skip
        self._model, self._data, self._base, self._robot = model, data, base, robot
        self._hangs = hangs
        self._standing = bool(robot.contacts) and base.velocities > 0 and not hangs
        self.may_fall = not robot.contacts and base.velocities > 0 and not hangs
        """True for a robot that nothing asks to stay as it starts: a free one without feet."""

    def stays(self, wanted: Array) -> bool:
        """Check whether the robot is still, its joints where they are held (``wanted``, as in ``check``)."""
        return not self._sagging(wanted) and not self._moving()

    def check(self, load: Array, wanted: Array, torque: Array, rotation: Array) -> None:
        """Raise ``StartError`` if the robot does not stand.

        The message gives the causes, or the symptoms if no cause is found.

        Args:
            load: the mean vertical force on every contact point [N], (n_contacts,).
            wanted: the joint positions in which the drives hold the robot [rad], (n_joints,).
            torque: the joint torques that hold it there without moving [N m], (n_joints,).
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
            f"standing pose for 0.3 s: {'; '.join(found)}; with `start: {{stand: false}}` it begins in that pose "
            "and falls if it falls"
        )

    def _unbalanced(self) -> list[str]:
        """Report a centre of mass outside of the support polygon."""
        places = np.array([self._data.site(c.name).xpos for c in self._robot.contacts])
        com = self._data.sensor("com").data
        loaded = np.ones(len(places), dtype=np.bool_)
        margin = support_margin(places, loaded, float(com[0]), float(com[1]))
        if self._base.velocities == 3:  # a robot with a planar base cannot fall sideways
            x, ahead = float(com[0]), places[:, 0]
            margin = min(x - float(ahead.min()), float(ahead.max()) - x)
        if margin > 0.0:
            return []
        way = _millimetres(-margin)
        return [f"its centre of mass is {way} outside its contact points, so it tips over"]

    def _touching(self) -> list[str]:
        """Report links that touch anything, and contact points that touch more than the ground."""
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
        """Report motors that are too weak to hold the robot; joints without motors do not count."""
        robot = self._robot
        needed = np.abs(product(robot.torque_to_motor, torque))
        found = []
        for k, peak in enumerate(robot.motors.peak_torque.tolist()):
            if peak > 0.0 and float(needed[k]) > peak:
                name, wanted = robot.transmission.motors[k], float(needed[k])
                unit = robot.motor_unit(k, "N m")
                found.append(
                    f"motor {name} has {peak:.3g} {unit} and would need {wanted:.3g} {unit}"
                )
        return _some(found)

    def _unloaded(self, load: Array) -> list[str]:
        """Report feet in the air, and a load on the feet that is not the robot's weight."""
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
        """Report joints that are not where they are held, the worst first."""
        away = self._data.qpos[self._base.positions :] - wanted
        text = "joint {name} is {value:+.2g} {unit} from where it is held"
        return self._joints(away, MOST_SAG, text, "rad", "m")

    def _moving(self) -> list[str]:
        """Report joints that still move, the worst first, and a base that does."""
        speeds = self._data.qvel[self._base.velocities :]
        text = "joint {name} moves at {value:.2g} {unit}"
        found = self._joints(speeds, MOST_JOINT_SPEED, text, "rad/s", "m/s")
        if self._hangs:
            return found
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
        """``text`` for every joint whose value is more than ``most``, the worst first."""
        worst = sorted(range(len(values)), key=lambda k: -abs(values.item(k)))
        found = []
        for k in worst:
            joint, value = self._robot.joints[k], values.item(k)
            unit = slide if joint.kind == "slide" else hinge
            if not abs(value) <= most:
                found.append(text.format(name=joint.name, value=value, unit=unit))
        return _some(found)

    def _tilted(self, rotation: Array) -> list[str]:
        """Report a base that has rotated since the robot was placed."""
        import mujoco

        turned = self._data.body(1).xmat.reshape(3, 3)
        cosine = 0.0
        for k in range(3):
            cosine += mujoco.mju_dot3(turned[k], rotation[k])
        angle = acos(min(1.0, max(-1.0, 0.5 * (cosine - 1.0))))
        if angle <= MOST_TILT_ERROR:
            return []
        return [f"its base has turned by {math.degrees(angle):.2g} deg from its standing pose"]


def _some(found: list[str]) -> list[str]:
    """Return the first few texts, and the number of the others."""
    more = len(found) - MOST_NAMED
    return found if more <= 0 else [*found[:MOST_NAMED], f"the same of {more} more"]


def _millimetres(length: float) -> str:
    return f"{1e3 * length:.2g} mm" if length < 0.01 else f"{1e3 * length:.0f} mm"
