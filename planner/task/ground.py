"""Builds the ground of a task for the simulator: a floor, with boxes where the ground is higher or
leans."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from ...robots.description import RobotDescription
from ...robots.kinematics import standing_contacts
from .files import JumpTaskError
from .sequence import (
    LEVEL,
    SHORTEST_JUMP_OVER_AN_EDGE,
    Hop,
    StanceLocation,
    changes_ground,
    edge_of,
)
from .task import JumpTask

GAP_DEPTH = 0.1
"""Depth of a gap's bottom below the lowest ground [m]."""
ROOM = 1.5
"""Length of a step or a platform beyond its edge [m]."""
WIDTH = 0.75
"""Reach of it to either side of the robot's places [m]."""

FOOTING = 0.02
"""Distance beyond its planned contact points at which a foot may land where the ground leans [m]."""

GroundRange = tuple[float, float, StanceLocation]
"""Stretch of ground: from, to [m, along the axis], and the place whose ground, going on, lies between them."""


@dataclass(frozen=True)
class _Edges:
    """The ground along one axis of the world: ``axis`` 0 is ahead, 1 to the left."""

    axis: int
    ranges: tuple[GroundRange, ...]

    def with_edge(self, at: float, forward: bool, place: StanceLocation) -> _Edges:
        """Return the ground whose whole part beyond an edge is that of another place."""
        low, high = (at, math.inf) if forward else (-math.inf, at)
        kept = [(a, min(b, at), z) if forward else (max(a, at), b, z)
                for a, b, z in self.ranges if (a < at if forward else b > at)]  # fmt: skip
        return _Edges(self.axis, _sorted([*kept, (low, high, place)]))

    def with_gap(self, low: float, high: float, height: float) -> _Edges:
        """Return the ground with another height between two places."""
        kept = [(max(a, c), min(b, d), z) for a, b, z in self.ranges
                for c, d in ((-math.inf, low), (high, math.inf))]  # fmt: skip
        found = [ground_range for ground_range in kept if ground_range[0] < ground_range[1]]
        bottom = StanceLocation(0.0, 0.0, height, 0.0, 0.0)
        return _Edges(self.axis, _sorted([*found, (low, high, bottom)]))

    def height(self, x: float, y: float) -> float:
        """Return the height of the ground there [m]."""
        at = (x, y)[self.axis]
        place = next(place for low, high, place in self.ranges if low <= at <= high)
        return float(place.height(x, y))


def _everywhere(place: StanceLocation, axis: int = 0) -> _Edges:
    """Return ground without edges: that of a place, going on."""
    return _Edges(axis, ((-math.inf, math.inf, place),))


def _sorted(ranges: list[GroundRange]) -> tuple[GroundRange, ...]:
    return tuple(sorted(ranges, key=lambda ground_range: ground_range[:2]))


def scene_of(task: JumpTask, robot: RobotDescription) -> Any:
    """Return the scene for the simulator (``hal.MujocoRobot``): ``flat``, or a floor with boxes.

    Each jump that lands higher or lower puts an edge under its flight, at ``step_edge`` or midway:
    along x, or along y where it goes aside only. Boxes reach 1.5 m beyond an edge where no other
    edge ends them. A ``gap`` is 0.1 m deeper than the lowest ground, and its middle is that place.
    Where the ground leans all of it is boxes, and the floor is 0.1 m below the lowest. ``stairs`` are
    stairs.

    Raises:
        JumpTaskError: a jump lands higher or lower or behind a gap where it stood, or two jumps of a row need different
            ground at the same place.
    """
    places, ground = task.places(), None
    hops = task.hops()
    if task.stairs is not None:
        return _stairs(task, robot)
    bottom = min(place.z for place in places) - GAP_DEPTH
    for number, hop in enumerate(hops):
        changes = changes_ground(hop, places[number])
        if not changes and not hop.gap:
            continue
        axis, at, forward = _edge(task, hop, places[number])
        if ground is None:
            ground = _everywhere(places[0], axis)
        if ground.axis != axis:
            raise JumpTaskError(
                f"{task.name}: landing_height: one jump has its step ahead and another aside; "
                "describe the ground yourself: robot.ground.scene"
            )
        if changes:
            ground = ground.with_edge(at, forward, places[number + 1])
        if hop.gap:
            ground = ground.with_gap(at - 0.5 * hop.gap, at + 0.5 * hop.gap, bottom)
    if ground is None and not task.leans:
        return "flat"
    ground = ground or _everywhere(places[0])
    _require_ground(task, robot, ground)
    return _leaning_scene(robot, ground, places) if task.leans else _scene(ground, places)


def _stairs(task: JumpTask, robot: RobotDescription) -> dict[str, Any]:
    """Return the task's stairs as data; every foot stands on one of them."""
    stairs = task.stairs
    assert stairs is not None
    for number, place in enumerate(task.places()):
        for x, _ in _soles(robot, place):
            if stairs.passed(x) != stairs.passed(place.x):
                raise JumpTaskError(
                    f"{task.name}: stairs: at place {number} a foot at x = {x:.3f} m is on another "
                    f"step than the soles' middle at {place.x:.3f} m; land elsewhere, or begin the "
                    "stairs elsewhere"
                )
    end = max(place.x for place in task.places()) + ROOM
    landing = max(_round(end - stairs.x - stairs.run * (stairs.steps - 1)), stairs.run)
    side = max(abs(place.y) for place in task.places()) + WIDTH
    steps = {"x": stairs.x, "y": [-side, side], "rise": stairs.rise, "run": stairs.run,
             "steps": stairs.steps, "landing": landing}  # fmt: skip
    if stairs.rise >= 0.0:
        return {"stairs": [steps]}
    start = {"x": [-ROOM, stairs.x], "y": [-side, side], "top": 0.0}
    floor = _round(stairs.rise * stairs.steps)
    return {"floor": floor, "boxes": [start | {"bottom": floor}], "stairs": [steps]}


def _edge(task: JumpTask, hop: Hop, start: StanceLocation) -> tuple[int, float, bool]:
    """Return the edge of the ground under a jump: the axis, the place along it, and whether the robot goes towards its
    positive end.
    """
    at = edge_of(hop, start)
    ahead = hop.distance_x or 0.0
    if at is None and hop.gap and not changes_ground(hop, start) and abs(ahead) > hop.gap:
        at = start.x + (0.5 * ahead if hop.step_edge is None else hop.step_edge)
    aside = hop.distance_y or 0.0
    if at is not None:
        return 0, at, at < start.x + (hop.distance_x or 0.0)
    if abs(aside) >= SHORTEST_JUMP_OVER_AN_EDGE:
        return 1, start.y + 0.5 * aside, aside > 0.0
    if hop.gap:
        raise JumpTaskError(
            f"{task.name}: gap: it jumps {abs(ahead):g} m ahead, and cannot pass a gap of {hop.gap:g} m; "
            "give a longer distance_x, or describe the ground yourself: robot.ground.scene"
        )
    if start.slope != (hop.landing_slope or LEVEL):
        raise JumpTaskError(
            f"{task.name}: landing_slope: it lands where it stood, and the ground leans otherwise "
            "there; give a distance_x, or the same slope"
        )
    raise JumpTaskError(
        f"{task.name}: landing_height: it lands {hop.landing_height:g} m higher or lower where it "
        "stood, and no such ground can be built; give a distance_x, or describe it yourself: "
        "robot.ground.scene"
    )


def _require_ground(task: JumpTask, robot: RobotDescription, ground: _Edges) -> None:
    """Refuse ground that is not everywhere as high as the robot's contacts need it."""
    for number, place in enumerate(task.places()):
        for x, y in _soles(robot, place):
            found, wanted = ground.height(x, y), float(place.height(x, y))
            if abs(found - wanted) > 1e-8:
                raise JumpTaskError(
                    f"{task.name}: landing_height: at place {number} a foot at ({x:.3f}, {y:.3f}) m "
                    f"needs ground at {wanted:g} m, and the steps of the task put it at {found:g} "
                    "m; move step_edge, narrow the gap, jump farther, or describe the ground yourself: robot.ground.scene"
                )


def _soles(robot: RobotDescription, place: StanceLocation) -> list[tuple[float, float]]:
    """Return the places of the contact points on the ground, as the robot stands at a place."""
    points = standing_contacts(robot)[:, :2]
    cosine, sine = math.cos(place.heading), math.sin(place.heading)
    return [
        (place.x + cosine * x - sine * y, place.y + sine * x + cosine * y)
        for x, y in points.tolist()
    ]


def _scene(ground: _Edges, places: tuple[StanceLocation, ...]) -> dict[str, Any]:
    """Return the ground as data: what is higher than the lowest part is a box on the floor."""
    floor = min(_round(place.z) for _, _, place in ground.ranges)
    boxes = [
        {"x": x, "y": y, "top": _round(place.z), "bottom": floor}
        for x, y, place in _extents(ground, places)
        if _round(place.z) > floor
    ]
    return {"floor": floor, "boxes": boxes}


def _leaning_scene(
    robot: RobotDescription, ground: _Edges, places: tuple[StanceLocation, ...]
) -> dict[str, Any]:
    """Return the ground as data where it leans. ``uneven`` is what the ground rises under the feet at the end."""
    extents = list(_extents(ground, places))
    lowest = min(float(p.height(a, b)) for x, y, p in extents for a in x for b in y)
    floor = _round(lowest - GAP_DEPTH)
    boxes = [
        {"x": x, "y": y, "top": _round(float(place.height(0.5 * sum(x), 0.5 * sum(y)))),
         "bottom": floor, "slope": list(place.slope)}
        for x, y, place in extents
    ]  # fmt: skip
    end = places[-1]
    feet = max(abs(float(end.height(x, y)) - end.z) for x, y in _soles(robot, end))
    more = FOOTING * sum(abs(math.tan(angle)) for angle in end.slope)
    return {"floor": floor, "boxes": boxes, "uneven": _round(feet + more)}


def _extents(
    ground: _Edges, places: tuple[StanceLocation, ...]
) -> Iterator[tuple[list[float], list[float], StanceLocation]]:
    """Yield the extents of each of the ranges along x and along y [m]."""
    along = [(p.x, p.y)[ground.axis] for p in places]
    aside = [(p.y, p.x)[ground.axis] for p in places]
    side = [_round(min(aside) - WIDTH), _round(max(aside) + WIDTH)]
    for low, high, place in ground.ranges:
        if high <= low:
            continue
        reach = [
            _round(low if math.isfinite(low) else min(high, *along) - ROOM),
            _round(high if math.isfinite(high) else max(low, *along) + ROOM),
        ]
        yield (reach, side, place) if ground.axis == 0 else (side, reach, place)


def _round(value: float) -> float:
    """Round to a micrometre, so that it reads well."""
    return round(value, 6) + 0.0
