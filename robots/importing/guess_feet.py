"""Guesses the feet of a URDF or MJCF file, which says nothing of them.

A foot is the last link of a limb of two joints or more that reaches down, at the zero of all
joints, nearly as far as the farthest one does. Balls that the file has there for collisions are
taken for its contact points; else it is a ball foot at the lowest body of the link.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .build import Built, Frame
from .raw_model import RawModel

REACH = 0.1
"""By how much less than the farthest limb a foot reaches down, as a share."""
LEVEL = 0.01
"""Contact points lie within this height [m]."""
RADIUS = 0.02
"""The radius of a foot whose shape the file does not give [m]."""


def guess_feet(model: RawModel, built: Built) -> list[dict[str, Any]]:
    """The feet as a short YAML has them: ``name``, ``at``, ``ball`` or ``points``, ``radius``."""
    heights = {link: _lowest(model, built, link) for link in _limb_ends(built)}
    lowest = min(heights.values(), default=0.0)
    if lowest >= 0.0:
        return []
    ends = [link for link, height in heights.items() if height <= (1.0 - REACH) * lowest]
    return [_foot(model, built, link) for link in ends]


def _limb_ends(built: Built) -> list[str]:
    """Links at the end of a chain of two joints or more."""
    parent = {joint["child"]: joint["parent"] for joint in built.joints}
    ends = [link for link in parent if link not in parent.values()]
    return [link for link in ends if parent[link] != built.base]


def _origins(built: Built) -> dict[str, Any]:
    """Where every link is at the zero of all joints [m, base frame]."""
    places = {built.base: np.zeros(3)}
    for joint in built.joints:
        places[joint["child"]] = places[joint["parent"]] + np.array(joint["origin"])
    return places


def _bodies(built: Built, link: str) -> dict[str, Frame]:
    return {name: frame for name, frame in built.frames.items() if frame.link == link}


def _lowest(model: RawModel, built: Built, link: str) -> float:
    """The lowest height of a link, with all that is fixed to it, at the zero of all joints [m]."""
    height = _origins(built)[link][2]
    found = [height]
    for name, frame in _bodies(built, link).items():
        found.append(height + frame.position[2])
        shapes = model.bodies[name].capsules if name in model.bodies else ()
        found += [height + frame.position[2] + shape.lowest(frame.rotation) for shape in shapes]
    return float(min(found))


def _foot(model: RawModel, built: Built, link: str) -> dict[str, Any]:
    bodies = _bodies(built, link)
    bottom = _lowest(model, built, link) - _origins(built)[link][2]
    balls = []
    for name, frame in bodies.items():
        for shape in model.bodies[name].capsules if name in model.bodies else ():
            is_ball = np.linalg.norm(shape.end - shape.start) < 0.1 * shape.radius
            if is_ball and frame.position[2] + shape.lowest(frame.rotation) < bottom + LEVEL:
                balls.append((name, frame, 0.5 * (shape.start + shape.end), shape.radius))
    if not balls:
        name = min(bodies, key=lambda body: float(bodies[body].position[2]))
        return {"name": name, "at": name, "radius": RADIUS}
    name, _, centre, radius = balls[0]
    if len(balls) == 1:
        ball = [float(value) for value in np.round(centre, 6) + 0.0]
        return {"name": name, "at": name, "ball": ball, "radius": round(radius, 6)}
    points = []
    for other, frame, middle, size in balls:
        if other == name:
            down = middle - size * frame.rotation[2]
            points.append([float(value) for value in np.round(down, 6) + 0.0])
    return {"name": name, "at": name, "points": points, "radius": round(radius, 6)}
