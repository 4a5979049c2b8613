"""Adapts an imported robot to the ground: its standing pose, and shapes that reach the ground.

A pose in which a robot stands has feet on one level, soles flat, and weight over their middle. It is found by
damped Gauss-Newton over the angles of the legs with the base upright. What must hold has a large
weight: the lowest points of all contacts at one height, soles that are flat parallel to the
ground, the centre of mass over the middle of the soles. What is wanted has a small one: feet below
the places where straight legs have them, whether or not knees can straighten, legs a little shorter than the limits let
them be, and angles near those of the start. The same robot gives the same angles, rounded to nine digits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ...mathematics.arrays import Array
from ..kinematics import (
    BallFoot,
    LinkPoses,
    ball_feet,
    contact_centres,
    link_poses,
    link_poses_in_base,
    standing_heights,
)
from ..robot_description import RobotDescription
from ..shapes import THINNEST, Capsule, Hull, Shape, edges, spread
from .capsules import coarse

CLEARANCE = 0.002
"""The least height above the ground of a shape that is no contact point [m]."""
FOOT_CLEARANCE = 0.01
"""The least height for shapes of a link with a foot, which tilts while the robot moves [m]."""
ABOUT_BALL, IN_BALL = 2.0, 0.9
"""Radii of a ball that is a foot: what is nearer to its centre than the first is the foot's own, and hulls end within the
second, as a fork that holds the ball would touch beside it when the leg leans."""


def fit_to_ground(
    robot: RobotDescription, standing_given: bool, start: Mapping[str, float]
) -> tuple[RobotDescription, list[str]]:
    """Return the robot with a standing pose and without shapes that reach the ground in it, and notes.

    A file's own shapes of the feet are where the contact points are: what touches the ground there
    is the contact point, and any other shape that touches it counts as a fall.
    """
    if not robot.feet:
        return robot, []
    notes = []
    if not standing_given:
        pose = find_standing_pose(robot, start)
        if pose.holds:
            robot = robot.changed(standing=pose.angles)
            notes.append("standing is not given: the pose was found")
        else:
            notes.append(
                f"no standing pose was found: contacts differ in height by {pose.level:.1g} m, soles "
                f"tilt by {pose.flatness:.1g} rad, the centre of mass is off by {pose.balance:.1g} m"
            )
    return _without_low_shapes(robot, notes), notes


def _without_low_shapes(robot: RobotDescription, notes: list[str]) -> RobotDescription:
    poses = link_poses_in_base(robot, robot.standing_position)
    ground = float(np.min(standing_heights(robot)))
    links, changed = [], []
    feet = {foot.link for foot in robot.feet}
    balls = {robot.feet[ball.foot].link: ball for ball in ball_feet(robot)}
    for link in robot.links:
        rotation, position = poses[link.name]
        room = ground + (FOOT_CLEARANCE if link.name in feet else CLEARANCE) - position[2]
        kept = list[Shape]()
        for shape in link.shapes:
            rest = _without_ball(shape, balls[link.name]) if link.name in balls else shape
            rest = None if rest is None else _above(rest, rotation, room)
            if rest is not None:
                kept.append(rest)
        if kept != [*link.shapes]:
            changed.append(link.name)
            link = link.model_copy(update={"shapes": tuple(kept)})
        links.append(link)
    if not changed:
        return robot
    notes.append(
        f"shapes of {', '.join(changed)} reach the ground in the standing pose and end above it: "
        "contact points stand for what touches it"
    )
    return robot.changed(links=tuple(links))


def _without_ball(shape: Shape, ball: BallFoot) -> Shape | None:
    """Return a shape of a leg's last link without what the ball that it ends in stands for, which touches the ground at
    whatever angle the leg leans: none if that is all of it, else a hull that ends inside the ball.
    """
    away = np.array(shape.corners) - ball.centre
    far = np.linalg.norm(away, axis=1)
    if far.max() + shape.radius <= ABOUT_BALL * ball.radius:
        return None
    near = far <= ABOUT_BALL * ball.radius
    if isinstance(shape, Capsule) or not near.any():
        return shape
    share = np.where(near, np.minimum(1.0, IN_BALL * ball.radius / np.maximum(far, 1e-9)), 1.0)
    corners = ball.centre + share[:, None] * away
    return Hull.model_validate({"corners": [coarse(corner) for corner in corners]})


def _above(shape: Shape, rotation: Array, room: float) -> Shape | None:
    """Return the shape, cut off where it is not above ``room`` [m] when the link is turned so; None where that leaves
    nothing.
    """
    return (
        _shortened(shape, rotation, room)
        if isinstance(shape, Capsule)
        else _cut(shape, rotation, room)
    )


def _cut(hull: Hull, rotation: Array, room: float) -> Hull | None:
    """Return the part of the hull that is above: its corners there, and where its edges pass through that height."""
    corners = np.array(hull.corners)
    heights = corners @ rotation[2] - room
    if heights.min() > 0.0:
        return hull
    found = [*corners[heights > 0.0]]
    for start, end in np.array(edges(hull)):
        first, second = rotation[2] @ start - room, rotation[2] @ end - room
        if first * second < 0.0:
            found.append(start + first / (first - second) * (end - start))
    if len(found) < 4 or spread(np.array(found)) < THINNEST:
        return None
    return Hull.model_validate({"corners": [coarse(corner) for corner in found]})


def _shortened(shape: Capsule, rotation: Array, room: float) -> Capsule | None:
    """Return the capsule with its lower end at that height."""
    ends = np.array([shape.start, shape.end])
    heights = ends @ rotation[2] - shape.radius
    low, high = int(np.argmin(heights)), int(np.argmax(heights))
    if heights[low] > room:
        return shape
    if heights[high] <= room:
        return None
    # The end stays a little apart from the other: a capsule has a length.
    share = (room - heights[low]) / (heights[high] - heights[low])
    ends[low] += min(share, 0.99) * (ends[high] - ends[low])
    start, end = (tuple(coarse(end)) for end in ends)
    if start == end:
        return None
    return Capsule.model_validate({"start": start, "end": end, "radius": shape.radius})


STEPS = 200
DAMPING = 1e-6
PULL = 1e-3
"""Weight of staying at the start, against one for each metre or radian that must hold."""
PLACE = 1e-2
"""Weight of the feet's places and of the height."""
WIDEST = 1.6
"""Largest start angle of a joint [rad], where its limits' middle is farther from zero."""
BENT = (0.4, -0.8, 0.4)
"""Start angles of a straight leg's pitch joints, from the hip down [rad]."""
SHARPEST = 1e-4
"""The tolerance of the conditions that must hold [m, rad]."""
MARGIN = 0.02
"""The share of a joint's range that is kept free at each limit."""


@dataclass(frozen=True)
class StandingPose:
    """Angles by joint, and by how much the pose fails [m, rad]: of the contacts' heights, of the
    soles' flatness, and of the centre of mass over the support's middle."""

    angles: Mapping[str, float]
    level: float
    flatness: float
    balance: float

    @property
    def holds(self) -> bool:
        """True if the robot stands in it."""
        return max(self.level, self.flatness, self.balance) < SHARPEST


def find_standing_pose(
    robot: RobotDescription, start: Mapping[str, float] | None = None, height: float = 0.85
) -> StandingPose:
    """Return a pose in which the robot stands.

    Args:
        robot: with at least one foot; ``held`` joints stay where they are held.
        start: angles by joint from which to search; it decides to which side knees bend. Legs
            start in the middle of their limits and other joints at zero where it gives nothing.
        height: of the base over the ground, as a share of that with straight legs.

    Raises:
        ValueError: the robot has no feet, or ``start`` names an unknown joint.
    """
    if not robot.feet:
        raise ValueError(f"{robot.name} has no feet to stand on")
    names = [joint.name for joint in robot.joints]
    unknown = [name for name in start or {} if name not in names]
    if unknown:
        raise ValueError(f"{robot.name} has no joint {', '.join(unknown)}")
    search = _GroundFit(robot, dict(start or {}), height)
    angles = search.run()
    level, flatness, balance = search.failure(angles)
    rounded = {name: round(float(a), 9) + 0.0 for name, a in zip(names, angles, strict=True)}
    return StandingPose(rounded, level, flatness, balance)


class _GroundFit:
    """The residuals of a pose and the iteration that brings them to zero."""

    def __init__(self, robot: RobotDescription, start: Mapping[str, float], height: float) -> None:
        self.robot = robot
        limits = robot.joint_limits
        bounded = np.where(np.isfinite(limits).all(axis=1, keepdims=True), limits, 0.0)
        room = MARGIN * (bounded[:, 1] - bounded[:, 0])
        self.lower, self.upper = limits[:, 0] + room, limits[:, 1] - room
        carrier = {joint.child: (k, joint.parent) for k, joint in enumerate(robot.joints)}
        legs = np.zeros(len(robot.joints), dtype=bool)
        for foot in robot.feet:
            link = foot.link
            while link in carrier:
                index, link = carrier[link]
                legs[index] = True
        held = np.array([joint.name in robot.held for joint in robot.joints], dtype=bool)
        self.free = np.flatnonzero(legs & ~held)
        middle = bounded.mean(axis=1)
        self.start = np.where(legs, np.clip(middle, -WIDEST, WIDEST), 0.0)
        for foot in robot.feet:
            self._bend(foot.link, carrier)
        given = {**start, **robot.held}
        for k, joint in enumerate(robot.joints):
            self.start[k] = given.get(joint.name, self.start[k])
        self.start = np.clip(self.start, limits[:, 0], limits[:, 1])
        self.index = {link.name: k for k, link in enumerate(robot.links)}
        self.masses = np.array([link.mass for link in robot.links])
        self.coms = np.array([link.com for link in robot.links])
        self.foot_of_point = np.array(robot.foot_of_contact())
        self.centres = contact_centres(robot)
        self.flat = [k for k in range(len(robot.feet)) if self._is_flat(k)]
        straight = np.where(held, self.start, 0.0)
        reached = np.where(held, self.start, np.clip(straight, limits[:, 0], limits[:, 1]))
        # Knees that cannot straighten put the feet ahead of or behind where they are below the hips.
        wanted, highest = self._points(self._poses(np.array([straight, reached])))[1]
        self.places = wanted[:, :2]
        self.height = height * (0.0 - highest[:, 2].mean())

    def _bend(self, link: str, carrier: Mapping[str, tuple[int, str]]) -> None:
        """Start a leg that is straight in the middle of its limits a little bent: a straight leg does not
        say to which side its knee goes, and no small change of its angles shortens it."""
        chain = []
        while link in carrier:
            index, link = carrier[link]
            joint = self.robot.joints[index]
            if joint.kind == "hinge" and abs(joint.axis[1]) > 0.7:
                chain.append(index)
        if len(chain) > 1 and not self.start[chain].any():
            for index, angle in zip(reversed(chain), BENT, strict=False):
                self.start[index] = angle * np.sign(self.robot.joints[index].axis[1])

    def _is_flat(self, foot: int) -> bool:
        """Check whether a foot has three contact points that are not in a line."""
        points = np.array([
            contact.position
            for contact in self.robot.contacts
            if contact.foot == self.robot.feet[foot].name
        ])  # fmt: skip
        return len(points) > 2 and np.linalg.matrix_rank(points - points[0], tol=1e-4) > 1

    def _poses(self, angles: Array) -> LinkPoses:
        count = len(angles)
        upright = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
        return link_poses(self.robot, np.zeros((count, 3)), upright, angles)

    def _points(self, poses: LinkPoses) -> tuple[Array, Array]:
        """Return the height of each contact's lowest point (n, n_contacts), each sole (n, n_feet, 3); that of a ball is
        its centre.
        """
        heights, balls = [], {}
        for foot, centre, contact in zip(
            self.foot_of_point, self.centres, self.robot.contacts, strict=True
        ):
            k = self.index[self.robot.feet[foot].link]
            place = poses.position[:, k] + poses.rotation[:, k] @ centre
            heights.append(place[:, 2] - contact.radius)
            balls[int(foot)] = place
        soles = []
        for k, each in enumerate(self.robot.feet):
            link = self.index[each.link]
            place = poses.position[:, link] + poses.rotation[:, link] @ np.array(each.sole)
            single = list(self.foot_of_point).count(k) == 1
            soles.append(balls[k] if single else place)
        return np.array(heights).T, np.moveaxis(np.array(soles), 0, 1)

    def parts(self, angles: Array) -> tuple[Array, Array, Array, Array]:
        """Return the residuals of many poses (n, n_joints): heights, flatness and balance, which must be zero, and what
        is only wanted, each (n, some).
        """
        poses = self._poses(angles)
        heights, soles = self._points(poses)
        level = heights - heights.mean(axis=1, keepdims=True)
        tilts = [poses.rotation[:, self.index[self.robot.feet[k].link]] for k in self.flat]
        flat = [np.stack([t[:, 2, 0], t[:, 2, 1], t[:, 1, 0]], axis=1) for t in tilts]
        flatness = np.concatenate([*flat, np.zeros((len(angles), 1))], axis=1)
        coms = poses.position + np.einsum("nkij,kj->nki", poses.rotation, self.coms)
        com = np.einsum("k,nki->ni", self.masses, coms) / self.masses.sum()
        support = soles.mean(axis=1)
        balance = com[:, :2] - support[:, :2]
        # Feet apart as with straight legs; where the support's middle is, balance decides.
        apart = (soles[:, :, :2] - support[:, None, :2]) - (self.places - self.places.mean(axis=0))
        tall = heights.mean(axis=1)[:, None] + self.height
        wanted = np.concatenate([apart.reshape(len(angles), -1), tall], axis=1)
        return level, flatness, balance, wanted

    def residuals(self, angles: Array) -> Array:
        """Return all weighted residuals, whose squares are minimised, (n, some)."""
        level, flatness, balance, wanted = self.parts(angles)
        pull = PULL * (angles - self.start)[:, self.free]
        return np.concatenate([level, flatness, balance, PLACE * wanted, pull], axis=1)

    def failure(self, angles: Array) -> tuple[float, float, float]:
        """Return the largest residual of the conditions that must hold."""
        level, flatness, balance, _ = self.parts(angles[None])
        largest = [float(np.abs(part).max()) for part in (level, flatness, balance)]
        return largest[0], largest[1], largest[2]

    def run(self) -> Array:
        """Return the pose near the start that minimises the sum of the squared residuals."""
        angles, damping = self.start.copy(), 1e-3
        angles[self.free] = np.clip(angles[self.free], self.lower[self.free], self.upper[self.free])
        cost = float(np.square(self.residuals(angles[None])).sum())
        for _ in range(STEPS):
            values, jacobian = self._linearised(angles, self.residuals)
            normal = jacobian.T @ jacobian
            scale = damping * np.diag(np.maximum(np.diag(normal), DAMPING))
            move = np.linalg.solve(normal + scale, -jacobian.T @ values)
            trial = angles.copy()
            trial[self.free] = np.clip(
                angles[self.free] + np.clip(move, -0.3, 0.3),
                self.lower[self.free], self.upper[self.free],
            )  # fmt: skip
            new = float(np.square(self.residuals(trial[None])).sum())
            if new < cost:
                done = np.abs(trial - angles).max() < 1e-12
                angles, cost, damping = trial, new, max(0.2 * damping, 1e-12)
                if done:
                    break
            else:
                damping *= 10.0
                if damping > 1e8:
                    break
        return self._settled(angles)

    def _settled(self, angles: Array) -> Array:
        """Return the nearest angles at which the conditions hold exactly, if the limits allow it."""
        for _ in range(5):
            values, jacobian = self._linearised(angles, self._must)
            move = np.linalg.lstsq(jacobian, -values, rcond=1e-8)[0]
            trial = angles.copy()
            trial[self.free] += move
            if np.abs(move).max(initial=0.0) > 0.01 or max(self.failure(trial)) > max(
                self.failure(angles)
            ):
                break
            angles = trial
        return angles

    def _must(self, angles: Array) -> Array:
        return np.concatenate(self.parts(angles)[:3], axis=1)

    def _linearised(self, angles: Array, function: Callable[[Array], Array]) -> tuple[Array, Array]:
        """Return a function's values and its Jacobian by the free joints, by central differences."""
        step, count = 1e-6, len(self.free)
        trials = np.tile(angles, (2 * count + 1, 1))
        for k, joint in enumerate(self.free):
            trials[1 + 2 * k, joint] += step
            trials[2 + 2 * k, joint] -= step
        values = function(trials)
        return values[0], (values[1::2] - values[2::2]).T / (2.0 * step)
