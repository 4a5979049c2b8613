"""Bodies of a file that seem to have lost a joint, or whose masses differ from those of their mirror images.

The dynamics of such a robot are sound, so no rule of descriptions finds it. A body of MJCF is part of its parent as soon
as its joint is lost. Left and right of most robots are mirror images about the base's x-z plane, body by body.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...files.problems import listing
from ...mathematics.arrays import Array
from .raw_model import RawBody, RawModel

MOST = 4
"""Names that a sentence lists."""
PLACE = 2e-3
"""m; a body within this of another one's mirrored place is its mirror image."""
MASS = 1.1
"""The ratio from which the masses of mirror images differ."""
SHARE = 0.02
"""A body without a joint that has a larger share of the robot's mass is named."""
NONE = 1e-3
"""kg; lighter bodies are frames."""
MIRROR = np.array([1.0, -1.0, 1.0])


def odd_bodies(model: RawModel) -> Iterator[str]:
    """Yield what seems odd, one sentence each."""
    pairs = [*_pairs(model)]
    moved = {name: _movers(body) for name, body in model.bodies.items()}
    lost = [
        f"{one.name} {_how_many(moved[one.name])} and {other.name}, its mirror image, {_how_many(moved[other.name])}"
        for one, other in pairs
        if len(moved[one.name]) != len(moved[other.name])
    ]
    if lost:
        yield f"left and right differ: {listing(lost, MOST)}; is a joint missing, or fixed?"
    masses = [(one, one.inertial.mass, other, other.inertial.mass) for one, other in pairs]
    heavier = [
        f"{one.name} has {mass:.4g} kg and {other.name}, its mirror image, {mirrored:.4g} kg"
        for one, mass, other, mirrored in masses
        if max(mass, mirrored, NONE) > MASS * max(min(mass, mirrored), NONE)
    ]
    if heavier:
        yield f"left and right differ: {listing(heavier, MOST)}"
    whole = sum(body.inertial.mass for body in model.bodies.values())
    still = [
        f"{body.name} ({body.inertial.mass:.3g} kg, part of {body.parent})"
        for body in model.bodies.values()
        if not model.is_urdf and not body.joints and body.parent in model.bodies
        and body.inertial.mass > SHARE * whole
    ]  # fmt: skip
    if still:
        yield f"bodies without a joint are part of what carries them: {listing(still, MOST)}"


def _movers(body: RawBody) -> list[str]:
    return [joint.name for joint in body.joints]


def _how_many(joints: list[str]) -> str:
    return f"moves by {listing(joints, MOST)}" if joints else "has no joint"


def _pairs(model: RawModel) -> Iterator[tuple[RawBody, RawBody]]:
    """Yield the pairs of bodies that are mirror images by place, as are those that carry them."""
    children: dict[str, list[RawBody]] = {}
    for body in model.bodies.values():
        children.setdefault(body.parent, []).append(body)
    for root in children.get(model.world, []):
        frame = (root.rotation, root.position)
        waiting = [(root, root)]
        while waiting:
            one, other = waiting.pop()
            left = children.get(one.name, [])
            right = [*children.get(other.name, [])]
            for body in left:
                mirrored = _image(body, right, frame)
                if mirrored is None:
                    continue
                right.remove(mirrored)
                if mirrored is not body and one is other and _place(body, frame)[1] < 0.0:
                    continue  # found from its other side
                waiting.append((body, mirrored))
                if mirrored is not body:
                    yield body, mirrored


def _place(body: RawBody, frame: tuple[Array, Array]) -> Array:
    """Return the place of a body in the frame of the root [m]."""
    rotation, position = frame
    place: Array = rotation.T @ (body.position - position)
    return place


def _image(body: RawBody, others: list[RawBody], frame: tuple[Array, Array]) -> RawBody | None:
    """Return the body at the mirrored place; of several the one of the most alike mass and joints."""
    wanted = MIRROR * _place(body, frame)
    near = [
        each for each in others
        if float(np.linalg.norm(_place(each, frame) - wanted)) < PLACE
    ]  # fmt: skip
    return min(near, key=lambda each: _unlike(body, each), default=None)


def _unlike(one: RawBody, other: RawBody) -> tuple[float, int]:
    return abs(one.inertial.mass - other.inertial.mass), abs(len(one.joints) - len(other.joints))
