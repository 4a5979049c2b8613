"""Scenes: the ground the robot stands and lands on, as a floor and boxes.

The world's origin is the ground point midway between the soles where the robot starts, so the
surface there is at z = 0 in every scene.
"""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.terrain import Ground, Terrain

Span = tuple[float, float]


def flat() -> Terrain:
    """A level floor."""
    return Terrain()


def nowhere() -> Terrain:
    """No ground: the floor is a kilometre below, out of reach of a robot on a fixed base."""
    return Terrain(floor=-1000.0)


def step(height: float, distance: float, depth: float = 1.5) -> Terrain:
    """A step of ``height`` [m] whose front edge is ``distance`` [m] ahead of the origin, and whose
    back edge is ``depth`` [m] further ahead."""
    return Terrain(blocks=(Ground((distance, -0.75, 0.0), (distance + depth, 0.75, height)),))


def platform(height: float, edge: float) -> Terrain:
    """A platform that the robot starts on, ``height`` [m] above the floor. Its edge is ``edge`` [m]
    ahead of the origin, or behind it if that is negative."""
    back, front = (edge - 0.6, edge) if edge >= 0.0 else (edge, edge + 0.6)
    return Terrain(-height, (Ground((back, -0.4, -height), (front, 0.4, 0.0)),))


class BoxParameters(Parameters):
    """A box, as a graph describes it."""

    x: Span = parameter(text="from, to; ahead of where the robot starts", unit="m")
    y: Span = parameter((-0.75, 0.75), unit="m", text="from, to; to the left of it")
    top: float = parameter(text="height of its upper face", unit="m")
    bottom: float = parameter(0.0, unit="m", text="height of its lower face")

    @model_validator(mode="after")
    def _check_extent(self) -> Self:
        for name, (low, high) in (("x", self.x), ("y", self.y), ("z", (self.bottom, self.top))):
            if not low < high:
                raise ValueError(f"a box must have an extent along {name}: {low:g} to {high:g} m")
        return self


class SceneParameters(Parameters):
    """Ground that a graph describes by itself: a level floor and boxes on it."""

    floor: float = parameter(0.0, unit="m", text="height of the floor")
    boxes: tuple[BoxParameters, ...] = parameter((), text="solid blocks")

    def build(self) -> Terrain:
        """The ground these parameters describe."""
        blocks = (
            Ground((box.x[0], box.y[0], box.bottom), (box.x[1], box.y[1], box.top))
            for box in self.boxes
        )
        return Terrain(self.floor, tuple(blocks))
