"""The robot's symbolic model, made once, and where the robot stands at the start and at the end of a jump."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...robots.welding import HeldLoad, welded
from ..task.files import PlanError
from ..task.scaling import per_robot
from ..task.sequence import LEVEL, Slope, StanceLocation, ground_axes
from ..task.task import JumpTask
from .euler_angles import ORDER, angles_of, pose_of, rotation
from .exact_dynamics import ExactDynamics
from .symbolic_model import SymbolicModel
from .symmetry import Pair, mirrored_pairs, symmetrised, symmetrised_angles

HARD, HARD_TURN = 40.0, 100.0
"""Accelerations of a link in a hard jump, gravity included [m/s^2, rad/s^2]."""
MATTERS = 0.5
"""Held joints that need less than this share of their motors in such a motion have no constraint."""
TWIN = 10.0
"""Factor on the tolerance within which the left and right angles of a mirrored twin's pose count as the same."""
ROUNDED = 6
"""Digits of such an angle."""
SAME = {"mass": 1.0, "com": (0.0, 0.0, 0.0), "inertia": (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)}
"""Properties of all links where only the joints of limbs are compared."""


def model_of(robot: RobotDescription) -> tuple[SymbolicModel, StanceFinder]:
    """Return the model of a robot without its held joints, with the actuator profile in use, and what places it on the
    ground.

    Raises:
        PlanError: held joints share motors with others.
    """
    return _model(robot, False)


def symmetric_model_of(robot: RobotDescription) -> tuple[SymbolicModel, StanceFinder]:
    """Return the same of the robot made exactly the same left and right, where it nearly is; else of the robot as it
    is.

    Raises:
        PlanError: held joints share motors with others.
    """
    return _model(robot, True)


@per_robot
def _model(
    robot: RobotDescription, symmetric: bool, loosely: float = 1.0
) -> tuple[SymbolicModel, StanceFinder]:
    try:
        part = welded(robot)
    except ValueError as error:
        raise PlanError(str(error), family="stance") from error
    robot, loads = part.robot, [load for load in part.loads if _matters(load)]
    compared = robot
    if loosely > 1.0:
        links = tuple(link.model_copy(update=SAME) for link in robot.links)
        compared = robot.changed(links=links)
    pairs = mirrored_pairs(compared) if symmetric else None
    model = SymbolicModel(symmetrised(robot, pairs) if pairs else robot, loads)
    return model, StanceFinder(model.robot, pairs or (), loosely)


def twin_model_of(robot: RobotDescription) -> tuple[SymbolicModel, StanceFinder] | None:
    """Return the same of a robot whose limbs mirror each other but whose masses do not, as Talos' do not by a little,
    made the same left and right: its jumps are good guesses for the robot's. ``None`` for other robots.

    Raises:
        PlanError: held joints share motors with others.
    """
    found = _model(robot, True, TWIN)
    return found if found[1].pairs and not symmetric_model_of(robot)[1].pairs else None


def _matters(load: HeldLoad) -> bool:
    """Check whether a hard jump could need a good part of what the joint's motor can hold: what moves on it may."""
    arm = np.linalg.norm(np.array(load.com) - np.array(load.origin))
    torque = load.mass * arm * HARD + max(load.inertia[:3]) * HARD_TURN
    return bool(load.carried) or bool(torque > MATTERS * load.most)


@dataclass(frozen=True)
class Stance:
    """A standing pose: ``coordinates`` (n_velocities), contact ``points`` (n_contacts, 3) and
    ``com`` in the world, ``heading`` of the feet [rad], the ``footholds`` (n_contacts, 3) that
    stay while the robot moves above them; they differ from the points where balls roll; and the
    ``slope`` of the ground."""

    coordinates: Array
    points: Array
    com: Array
    heading: float
    footholds: Array
    slope: Slope = LEVEL


LEANS = 4
"""Steps of the search for the base's lean; each is exact for feet that do not roll."""
UNEVEN = 5e-4
"""m; by how much the contact points of a stance may be above or below the ground."""
LEAN_ROUNDS, LEG_STEPS = 12, 20
"""Iterations of the search for a stance on ground that leans: of the base's place, and of the legs for each."""
REACHED, BALANCED = 1e-12, 1e-10
"""m; what feet miss of such ground at most, and the centre of mass of where it stands on level ground."""
MOST_PLACED = 64
"""Stances that are kept."""
UPRIGHT_REACH = 1e-7
"""m; by more than this the legs do not reach ground that leans."""


class StanceFinder:
    """Places a robot on the ground for given joint angles, with all contact points on it."""

    def __init__(
        self, robot: RobotDescription, pairs: Sequence[Pair] = (), loosely: float = 1.0
    ) -> None:
        """Give ``pairs`` of limbs the same angles where they are to have almost the same ones; ``loosely`` multiplies
        what almost means.
        """
        self.robot, self.pairs, self.loosely = robot, tuple(pairs), loosely
        self._body = ExactDynamics(robot)
        self._placed: dict[tuple[bytes, StanceLocation], Stance] = {}
        self._levelled: dict[bytes, Array] = {}

    def on_ground(self, joints: Array, place: StanceLocation) -> Stance:
        """Return the stance at a place. On ground that leans the base is as upright as on level ground, and the centre
        of mass as far from the soles' middle: only the legs differ. The base is lower by as much as the lowest foot is.

        Raises:
            PlanError: there is none on level ground, or the legs do not reach ground that leans.
        """
        # Jumps begin in the same stance again and again.
        key = joints.tobytes(), place
        if key not in self._placed:
            if len(self._placed) > MOST_PLACED:
                self._placed.clear()
            self._placed[key] = self._on_ground(joints, place)
        return self._placed[key]

    def _on_ground(self, joints: Array, place: StanceLocation) -> Stance:
        at = (place.x, place.y, place.z)
        level = self.place(joints, heading=place.heading, at=at)
        if place.slope == LEVEL:
            return level
        axes = ground_axes(place.slope, place.heading)
        turn = axes @ ground_axes(LEVEL, place.heading).T
        soles = self._body.soles(pose_of(level.coordinates))[0] - at
        goals = at + (level.points - at) @ turn.T
        q = level.coordinates.copy()
        q[2] += min(0.0, float((soles @ turn.T)[:, 2].min()))
        for _ in range(LEAN_ROUNDS):
            q = self._on_points(q, goals)
            missed = level.com[:2] - self._body.com(pose_of(q))[:2]
            if np.abs(missed).max() < BALANCED:
                break
            q[:2] += missed
        points = self._body.points(pose_of(q))
        off = float(np.abs(points - goals).max())
        limits = self.robot.joint_limits
        past = np.maximum(q[6:] - limits[:, 1], limits[:, 0] - q[6:])
        if off > UPRIGHT_REACH or past.max() > 0.0:
            joint = self.robot.joints[int(past.argmax())].name
            why = (
                f"{joint} would pass its limit" if past.max() > 0.0 else "a foot does not reach it"
            )
            ahead, left = np.degrees(place.slope)
            raise PlanError(
                f"{self.robot.name} cannot stand upright on ground that rises by {ahead:.4g} deg "
                f"along x and {left:.4g} deg along y: {why}; ask for a smaller slope",
                family="stance", violation=max(off, float(past.max())),
            )  # fmt: skip
        footholds = level.footholds - level.points + points
        return Stance(q, points, self._body.com(pose_of(q)), place.heading, footholds, place.slope)

    def _on_points(self, q: Array, goals: Array) -> Array:
        """Return the coordinates with joints for which the contact points are at those places."""
        q = q.copy()
        for _ in range(LEG_STEPS):
            points, jacobian = self._body.contact_jacobians(pose_of(q))
            error = (goals - points).ravel()
            if np.abs(error).max() < REACHED:
                break
            step = np.linalg.lstsq(jacobian[:, 6:], error, rcond=1e-6)[0]
            q[6:] += step * min(1.0, 0.3 / max(np.abs(step).max(), 1e-12))
        return q

    def _level(self, joints: Array) -> Array:
        """Return the coordinates with those joints, over the origin, whose base leans as in ``place``."""
        key = joints.tobytes()
        if key not in self._levelled:
            if len(self._levelled) > MOST_PLACED:
                self._levelled.clear()
            alike = self.loosely * symmetrised_angles(self.pairs, joints / self.loosely)
            if self.loosely > 1.0:
                # What one side leans to the other is the rest of a sum, not exactly zero.
                alike = alike.round(ROUNDED)
            q = np.concatenate([np.zeros(6), alike])
            for _ in range(LEANS):
                # Balls touch elsewhere as the base leans, so one step is not quite enough for them.
                points = self._body.points(pose_of(q))
                q[3:5] = _lean(_base_rotation(q).T @ _normal(points))
            self._levelled[key] = q
        return self._levelled[key].copy()

    def place(
        self, joints: Array, *, heading: float = 0.0, at: tuple[float, float, float] = (0, 0, 0)
    ) -> Stance:
        """Return the stance with the soles' middle over ``at`` [m] and the contact points at its height.

        The base leans so that the plane through all contact points is level.

        Raises:
            PlanError: the contact points do not lie in one plane with these joint angles, or there
                are none.
        """
        if not self.robot.contacts:
            raise PlanError(f"{self.robot.name} has no contact points to stand on", family="stance")
        q = self._level(joints)
        if heading:  # turn the leaning pose as a whole: R = Rz(heading) R(lean)
            q[3:6] = _turned(q, heading)
        points = self._body.points(pose_of(q))
        q[:2] = at[:2] - self._body.sole_places().mean(axis=0)[:2]
        q[2] = at[2] - points[:, 2].mean()
        points = self._body.points(pose_of(q))
        footholds = self._body.footholds(heading)
        com = self._body.com(pose_of(q))
        heights = points[:, 2] - at[2]
        if np.abs(heights).max() > UNEVEN:
            names = [contact.name for contact in self.robot.contacts]
            found = ", ".join(f"{n} {1e3 * h:+.1f} mm" for n, h in zip(names, heights, strict=True))
            raise PlanError(
                "with these joint angles the contact points do not lie in one plane: they are off "
                f"the best one by {found}; choose angles that put all feet on the ground",
                family="stance",
            )
        return Stance(q, points, com, heading, footholds)


def stances_of(task: JumpTask, robot: RobotDescription, finder: StanceFinder
               ) -> tuple[Stance, ...]:  # fmt: skip
    """Return the task's stances: at the start, between jumps, with the same joint angles, and at the end. The pitch
    includes the body's turns so far.
    """
    names = [joint.name for joint in finder.robot.joints]
    first, last = task.start_joints(robot), task.end_joints(robot)
    places = task.places()
    found = []
    for number, place in enumerate(places):
        angles = last if number == len(places) - 1 else first
        stance = finder.on_ground(np.array([angles[name] for name in names]), place)
        turned = stance.coordinates.copy()
        turned[3] += place.turned
        found.append(replace(stance, coordinates=turned))
    return tuple(found)


def _normal(points: Array) -> Array:
    """Return the upward normal of the plane nearest to points (n, 3); it leans in no direction in which the points have
    no width, so one point or a line of them is on level ground as it is.
    """
    off = points - points.mean(axis=0)
    slopes = np.linalg.lstsq(off[:, :2], off[:, 2], rcond=1e-6)[0]
    normal = np.array([-slopes[0], -slopes[1], 1.0])
    return np.asarray(normal / np.linalg.norm(normal))


def _lean(normal: Array) -> Array:
    """Return the pitch and roll of the base that make a direction of the body vertical."""
    roll = np.arctan2(normal[1], normal[2])
    return np.array([np.arctan2(-normal[0], np.hypot(normal[1], normal[2])), roll])


def _base_rotation(q: Array) -> Array:
    """Return the rotation from body to world of a base with the pitch, roll and yaw of the coordinates ``q``."""
    return rotation(q[3:6][ORDER])


def _turned(q: Array, heading: float) -> Array:
    """Return the pitch, roll and yaw of a base that leans as in the coordinates ``q`` and is then turned by
    ``heading``.
    """
    turn = rotation(np.array([0.0, 0.0, heading]))
    return angles_of(turn @ _base_rotation(q))[ORDER]
