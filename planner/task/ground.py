"""Builds the ground of a task for the simulator: a floor, with boxes where the ground is higher."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ...robots.description import RobotDescription
from ...robots.kinematics import standing_contacts
from .files import JumpTaskError
from .sequence import SHORTEST_JUMP_OVER_AN_EDGE, Hop, StanceLocation, edge_of
from .task import JumpTask

GAP_DEPTH = 0.1
"""How far the bottom of a gap is below the lowest ground [m]."""
ROOM = 1.5
"""How far a step or a platform reaches beyond its edge [m]."""
WIDTH = 0.75
"""How far it reaches to either side of the robot's places [m]."""

Stretch = tuple[float, float, float]
"""From, to [m, along the axis], and the height of the ground between them [m]."""


@dataclass(frozen=True)
class _Edges:
    """The ground along one axis of the world: ``axis`` 0 is ahead, 1 to the left."""

    axis: int
    stretches: tuple[Stretch, ...] = ((-math.inf, math.inf, 0.0),)

    def with_edge(self, at: float, forward: bool, height: float) -> _Edges:
        """The ground whose whole part beyond an edge has another height."""
        low, high = (at, math.inf) if forward else (-math.inf, at)
        kept = [(a, min(b, at), z) if forward else (max(a, at), b, z)
                for a, b, z in self.stretches if (a < at if forward else b > at)]  # fmt: skip
        return _Edges(self.axis, tuple(sorted([*kept, (low, high, height)])))

    def with_gap(self, low: float, high: float, height: float) -> _Edges:
        """The ground with another height between two places."""
        kept = [(max(a, c), min(b, d), z) for a, b, z in self.stretches
                for c, d in ((-math.inf, low), (high, math.inf))]  # fmt: skip
        found = [stretch for stretch in kept if stretch[0] < stretch[1]]
        return _Edges(self.axis, tuple(sorted([*found, (low, high, height)])))

    def height(self, at: float) -> float:
        """The height of the ground there [m]."""
        return next(z for low, high, z in self.stretches if low <= at <= high)


def scene_of(task: JumpTask, robot: RobotDescription) -> Any:
    """The scene for the simulator (``hal.MujocoRobot``): ``flat``, or a floor with boxes.

    Each jump that lands higher or lower puts an edge under its flight, at ``step_edge`` or midway:
    along x, or along y where it goes aside only. Boxes reach 1.5 m beyond an edge where no other
    edge ends them. A ``gap`` is 0.1 m deeper than the lowest ground, and its middle is that place.

    Raises:
        JumpTaskError: a jump lands higher or lower or behind a gap where it stood, or two jumps of a row need different
            ground at the same place.
    """
    places, ground = task.places(), None
    hops = task.hops()
    bottom = min(place.z for place in places) - GAP_DEPTH
    for number, hop in enumerate(hops):
        if not hop.landing_height and not hop.gap:
            continue
        axis, at, forward = _edge(task, hop, places[number])
        if ground is None:
            ground = _Edges(axis)
        if ground.axis != axis:
            raise JumpTaskError(
                f"{task.name}: landing_height: one jump has its step ahead and another aside; "
                "describe the ground yourself: robot.scene"
            )
        if hop.landing_height:
            ground = ground.with_edge(at, forward, places[number + 1].z)
        if hop.gap:
            ground = ground.with_gap(at - 0.5 * hop.gap, at + 0.5 * hop.gap, bottom)
    if ground is None:
        return "flat"
    _require_ground(task, robot, ground)
    return _scene(ground, places)


def _edge(task: JumpTask, hop: Hop, start: StanceLocation) -> tuple[int, float, bool]:
    """Where the ground changes under a jump: the axis, the place along it, and whether the robot
    goes towards its positive end."""
    at = edge_of(hop, start)
    ahead = hop.distance_x or 0.0
    if at is None and hop.gap and not hop.landing_height and abs(ahead) > hop.gap:
        at = start.x + (0.5 * ahead if hop.step_edge is None else hop.step_edge)
    aside = hop.distance_y or 0.0
    if at is not None:
        return 0, at, at < start.x + (hop.distance_x or 0.0)
    if abs(aside) >= SHORTEST_JUMP_OVER_AN_EDGE:
        return 1, start.y + 0.5 * aside, aside > 0.0
    if hop.gap:
        raise JumpTaskError(
            f"{task.name}: gap: it jumps {abs(ahead):g} m ahead, and cannot pass a gap of {hop.gap:g} m; "
            "give a longer distance_x, or describe the ground yourself: robot.scene"
        )
    raise JumpTaskError(
        f"{task.name}: landing_height: it lands {hop.landing_height:g} m higher or lower where it "
        "stood, and no such ground can be built; give a distance_x, or describe it yourself: "
        "robot.scene"
    )


def _require_ground(task: JumpTask, robot: RobotDescription, ground: _Edges) -> None:
    """Refuse ground that is not everywhere as high as the robot's contacts need it."""
    for number, place in enumerate(task.places()):
        for x, y in _soles(robot, place):
            found = ground.height((x, y)[ground.axis])
            if abs(found - place.z) > 1e-9:
                raise JumpTaskError(
                    f"{task.name}: landing_height: at place {number} a foot at ({x:.3f}, {y:.3f}) m "
                    f"needs ground at {place.z:g} m, and the steps of the task put it at {found:g} "
                    "m; move step_edge, narrow the gap, jump farther, or describe the ground yourself: robot.scene"
                )


def _soles(robot: RobotDescription, place: StanceLocation) -> list[tuple[float, float]]:
    """Where the contact points are on the ground, as the robot stands at a place."""
    points = standing_contacts(robot)[:, :2]
    cosine, sine = math.cos(place.heading), math.sin(place.heading)
    return [
        (place.x + cosine * x - sine * y, place.y + sine * x + cosine * y)
        for x, y in points.tolist()
    ]


def _scene(ground: _Edges, places: tuple[StanceLocation, ...]) -> dict[str, Any]:
    """The ground as data: what is higher than the lowest part is a box on the floor."""
    floor = min(_round(z) for _, _, z in ground.stretches)
    along = [(p.x, p.y)[ground.axis] for p in places]
    aside = [(p.y, p.x)[ground.axis] for p in places]
    side = [_round(min(aside) - WIDTH), _round(max(aside) + WIDTH)]
    boxes = []
    for low, high, top in ground.stretches:
        if _round(top) <= floor or high <= low:
            continue
        reach = [
            _round(low if math.isfinite(low) else min(high, *along) - ROOM),
            _round(high if math.isfinite(high) else max(low, *along) + ROOM),
        ]
        x, y = (reach, side) if ground.axis == 0 else (side, reach)
        boxes.append({"x": x, "y": y, "top": _round(top), "bottom": floor})
    return {"floor": floor, "boxes": boxes}


def _round(value: float) -> float:
    """To a micrometre, so that it reads well."""
    return round(value, 6) + 0.0
