"""The robot's contacts: arrows of force, friction cones, the support polygon, loads and flights.

The load on a foot is the sum of the vertical forces on its contact points. A plot of every component
of every contact force has a dozen lines in like colours; one line a foot reads at a glance, so the
viewer shows these first. The peak of a landing may be ten times the load in stance: the plot's range
shows the stance, and an event tells the peak.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...robots.kinematics import LinkPoses
from ...robots.robot_description import RobotDescription
from ..file.format import PLOTS, Header, RecordedRows, time_columns
from .drawing import ChangedRows, Moments, SceneDisplay, ThinnedRows
from .robot_shapes import reach_of

WEIGHT_ARROW = 0.6
"""The length of the arrow of a robot's weight, as a share of the robot's reach. A robot that stands
on four points has arrows a quarter as long, which are still easy to see."""
LONGEST_ARROW = 1.0
"""No arrow is longer than this share of the robot's reach, or else it would leave the view."""
ARROW_RADIUS = 0.004
"""The radius of an arrow's shaft [m] for a robot of the usual reach."""
CONE_HEIGHT = 0.05
"""Height [m] at which a friction cone is cut, for a robot of the usual reach."""
CONE_SIDES = 16
ABOVE_GROUND = 0.001
"""Lines on the ground are drawn this far above it [m], so that the grid does not hide them."""


def force_scale(robot: RobotDescription) -> float:
    """Return the length of a force arrow for each newton [m/N]: small robots have small forces."""
    return WEIGHT_ARROW * reach_of(robot) / robot.weight


def force_arrows(robot: RobotDescription, force: Array) -> Array:
    """Return the arrows [m] of forces [N], both (..., 3), none longer than the robot's reach
    allows."""
    arrows = force * force_scale(robot)
    lengths = np.linalg.norm(arrows, axis=-1, keepdims=True)
    longest = LONGEST_ARROW * reach_of(robot)
    shorter: Array = arrows * np.minimum(1.0, longest / np.maximum(lengths, 1e-12))
    return shorter


def thruster_forces(
    robot: RobotDescription, poses: LinkPoses, thrust: Array
) -> tuple[Array, Array]:
    """Compute the points at which the thrusters push and their forces, for ``thrust`` (n,
    n_thrusters) [N]: both (n, n_thrusters, 3) [m, N, world]."""
    places, forces = [], []
    for k, thruster in enumerate(robot.thrusters.values()):
        position, rotation = poses.of(thruster.link)
        places.append(position + rotation @ np.array(thruster.position))
        forces.append(thrust[:, k, None] * (rotation @ np.array(thruster.axis)))
    return np.stack(places, axis=1), np.stack(forces, axis=1)


class ContactDisplay(SceneDisplay):
    """``contact_forces``, ``friction_cones`` and ``support_polygon``.

    A cone stands on each point that carries load; its half angle is the arc tangent of the
    friction coefficient that the controller counts with. It is not drawn where no block has one.
    """

    def write_static(self) -> None:
        """Write the colours."""
        import rerun as rr

        if self.ports.contact_force is None:
            return
        width = ARROW_RADIUS * self.scale
        arrows = rr.Arrows3D.from_fields(colors=[self.colors.force], radii=[width])
        self.log("contact_forces", arrows)
        thin, thick = 0.0006 * self.scale, 0.002 * self.scale
        cones = rr.LineStrips3D.from_fields(colors=[self.colors.cone], radii=[thin])
        self.log("friction_cones", cones)
        polygon = rr.LineStrips3D.from_fields(colors=[self.colors.support], radii=[thick])
        self.log("support_polygon", polygon)

    def write(self, moments: Moments) -> None:
        """Write the forces, the cones and the polygon."""
        import rerun as rr

        if self.ports.contact_position is None or self.ports.contact_force is None:
            return
        position = moments[self.ports.contact_position]
        force = moments[self.ports.contact_force]
        arrows = rr.Arrows3D.columns(
            origins=position.reshape(-1, 3),
            vectors=force_arrows(self.robot, force).reshape(-1, 3),
        )
        counts = np.full(len(position), position.shape[1])
        self.send("contact_forces", moments, arrows.partition(counts))
        loaded = (force != 0.0).any(axis=2)
        if self.ports.friction and self.detail.extras:
            self._write_cones(moments, position, loaded, self.ports.friction)
        self._write_polygon(moments, position, loaded)

    def _write_cones(
        self, moments: Moments, position: Array, loaded: NDArray[np.bool_], friction: float
    ) -> None:
        cone = cone_lines(friction, CONE_HEIGHT * self.scale)
        self._write_lines(
            "friction_cones", moments, position[loaded][:, None] + cone, loaded.sum(1)
        )

    def _write_polygon(self, moments: Moments, position: Array, loaded: NDArray[np.bool_]) -> None:
        polygons = [
            convex_hull(points[carry]) + np.array([0.0, 0.0, ABOVE_GROUND])
            for points, carry in zip(position, loaded, strict=True)
        ]
        counts = np.array([len(polygon) > 0 for polygon in polygons], np.int64)
        self._write_lines(
            "support_polygon", moments, [polygon for polygon in polygons if len(polygon)], counts
        )

    def _write_lines(
        self, name: str, moments: Moments, lines: Sequence[Array] | Array, counts: NDArray[np.int64]
    ) -> None:
        import rerun as rr

        columns = rr.LineStrips3D.columns(strips=[np.asarray(line) for line in lines])
        self.send(name, moments, columns.partition(counts))


def cone_lines(friction: float, height: float) -> Array:
    """Draw one line (n, 3) of a friction cone on its tip: a ring with four sides to the tip."""
    angles = np.linspace(0.0, 2.0 * np.pi, CONE_SIDES + 1)
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.full(len(angles), 1.0 / friction)])
    ring *= friction * height
    tip, quarter = np.zeros((1, 3)), CONE_SIDES // 4
    sides = [np.vstack([tip, ring[k * quarter : k * quarter + 1], tip]) for k in range(1, 4)]
    return np.vstack([*sides, tip, ring])


def convex_hull(points: Array) -> Array:
    """Compute the closed convex hull (m, 3), seen from above, of points (n, 3), each at its own
    height.

    Empty where there are fewer than two points; a line there and back where all lie on one.
    """
    ordered = sorted({tuple(point) for point in points.tolist()})
    if len(ordered) < 2:
        return np.zeros((0, 3))
    chains = []
    for direction in (ordered, ordered[::-1]):
        chain: list[tuple[float, ...]] = []
        for point in direction:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        chains.append(chain)
    return np.array([*chains[0], *chains[1][1:]])


def _turn(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> float:
    """Return a number that is positive if the path a, b, c turns to the left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


FOOT_FORCE = f"{PLOTS}/foot_force"
WEIGHT = f"{PLOTS}/weight"
"""The robot's weight, as a line in the same plot."""
COLORS = (
    0xFFA726FF, 0x26C6DAFF, 0xEC407AFF, 0xC0CA33FF, 0x7E57C2FF, 0x66BB6AFF,
)  # fmt: skip
GREY = 0x9E9E9EB0
RANGE = (-0.15, 3.0)
"""First range of the plot, in weights of the robot."""
AFTER_TOUCHDOWN = 0.1
"""Time after a touchdown in which its peak is looked for [s]."""


def loads_on_feet(robot: RobotDescription, force: Array) -> Array:
    """Return the vertical force on each foot [N], (n, n_feet), of forces on contacts (n,
    n_contacts, 3)."""
    foot = np.array(robot.foot_of_contact())
    columns = [force[:, foot == k, 2].sum(axis=1) for k in range(len(robot.feet))]
    return np.column_stack(columns)


class FootForces:
    """Writes ``plots/foot_force`` and ``plots/weight`` below ``root``, batch by batch."""

    def __init__(
        self,
        stream: Any,
        header: Header,
        force: str,
        root: str,
        picker: ChangedRows | ThinnedRows | None = None,
    ) -> None:
        assert header.robot is not None
        self._stream, self._header, self._robot = stream, header, header.robot
        self._force, self._root = force, root
        self._picker = picker

    def write_static(self) -> None:
        """Write names and colours."""
        import rerun as rr

        count = len(self._robot.feet)
        feet = rr.SeriesLines(
            names=[foot.name for foot in self._robot.feet],
            colors=np.array([COLORS[k % len(COLORS)] for k in range(count)], np.uint32),
            widths=[1.5] * count,
            aggregation_policy="Off",
        )
        self._stream.log(f"{self._root}{FOOT_FORCE}", feet, static=True)
        line = rr.SeriesLines(names=["weight"], colors=[GREY], aggregation_policy="Off")
        self._stream.log(f"{self._root}{WEIGHT}", line, static=True)

    def write(self, batch: RecordedRows) -> None:
        """Write the loads at every tick of a batch at which they change."""
        loads = loads_on_feet(self._robot, batch.signal(self._force))
        ticks = batch.ticks
        if self._picker is not None:
            ticks, loads = self._picker.pick(ticks, loads)
        self._send(FOOT_FORCE, ticks, loads)
        ends = batch.ticks[[0, -1]] if len(batch.ticks) > 1 else batch.ticks
        self._send(WEIGHT, ends, np.full((len(ends), 1), self._robot.weight))

    def write_rest(self) -> None:
        """Write the last loads, if they were constant in the end."""
        rest = self._picker.rest() if self._picker is not None else None
        if rest is not None:
            self._send(FOOT_FORCE, *rest)

    def _send(self, entity: str, ticks: NDArray[np.int64], values: Array) -> None:
        import rerun as rr

        if len(ticks):
            columns = rr.Scalars.columns(scalars=np.ascontiguousarray(values))
            times = time_columns(self._header, ticks)
            self._stream.send_columns(f"{self._root}{entity}", times, columns)


class LandingPeaks:
    """Finds the largest load on a foot in the ``most`` ticks after each touchdown."""

    def __init__(self, robot: RobotDescription, most: int) -> None:
        self._robot, self._most = robot, most
        self._left = 0
        self._peak = (0.0, 0, "")

    def add(
        self, ticks: NDArray[np.int64], force: Array, touchdowns: list[int]
    ) -> list[tuple[int, str]]:
        """Return the events, as (tick, text), of further ticks (n,) with forces (n, n_contacts, 3)."""
        if not self._left and not touchdowns:
            return []
        events = []
        loads = loads_on_feet(self._robot, force)
        largest, which = loads.max(axis=1), loads.argmax(axis=1)
        for k, tick in enumerate(ticks.tolist()):
            if tick in touchdowns:
                self._left, self._peak = self._most, (0.0, tick, "")
            if self._left:
                if largest[k] > self._peak[0]:
                    self._peak = (float(largest[k]), tick, self._robot.feet[int(which[k])].name)
                self._left -= 1
                if not self._left and self._peak[2]:
                    force_, when, foot = self._peak
                    weights = force_ / self._robot.weight
                    text = f"landing: {force_:.0f} N on {foot}, {weights:.1f} times the weight"
                    events.append((when, text))
        return events


SHORTEST_FLIGHT = 0.03
"""Without load for less [s] is a bounce, not a flight."""
LIFT_OFF, TOUCHDOWN = "lift-off", "touchdown"
"""The texts of the events."""


class Flights:
    """Finds when the robot left the ground and when it came back.

    A time in the air that is shorter than ``least`` ticks is a bounce and no event."""

    def __init__(self, least: int) -> None:
        self._least = least
        self._began: int | None = None
        self._told = False

    def add(self, ticks: NDArray[np.int64], loaded: NDArray[np.bool_]) -> list[tuple[int, str]]:
        """Return the events, as (tick, text), that show in further ticks.

        ``loaded`` (n, n_contacts) says which points carry load.
        """
        events: list[tuple[int, str]] = []
        on_ground: list[bool] = np.atleast_1d(loaded.any(axis=1)).tolist()
        for tick, standing in zip(ticks.tolist(), on_ground, strict=True):
            if standing:
                if self._told:
                    events.append((tick, TOUCHDOWN))
                self._began, self._told = None, False
                continue
            if self._began is None:
                self._began = tick
            if not self._told and tick - self._began >= self._least - 1:
                events.append((self._began, LIFT_OFF))
                self._told = True
        return events
