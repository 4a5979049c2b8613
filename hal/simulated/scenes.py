"""Scenes: the ground the robot stands and lands on, as a floor and boxes.

The world's origin is the ground point midway between the soles where the robot starts, so the
surface there is at z = 0 in every scene.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from pydantic import model_validator

from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.terrain import Ground, Terrain

Span = tuple[float, float]


@dataclass(frozen=True)
class Box:
    """A solid block whose faces are normal to the axes, given by its extent in x and y and by its
    ``top`` and ``bottom`` [m, world]."""

    x: tuple[float, float]
    y: tuple[float, float]
    top: float
    bottom: float


@dataclass(frozen=True)
class Scene:
    """A level floor at height ``floor`` [m, world] and boxes on it."""

    floor: float = 0.0
    boxes: tuple[Box, ...] = ()

    def ground_height(self, x: float, y: float) -> float:
        """The height [m, world] of the highest surface at that place."""
        height = self.floor
        for box in self.boxes:
            if box.top > height and box.x[0] <= x <= box.x[1] and box.y[0] <= y <= box.y[1]:
                height = box.top
        return height

    def terrain(self) -> Terrain:
        """The same ground as a viewer draws it."""
        boxes = (
            Ground((box.x[0], box.y[0], box.bottom), (box.x[1], box.y[1], box.top))
            for box in self.boxes
        )
        return Terrain(self.floor, tuple(boxes))


def flat() -> Scene:
    """A level floor."""
    return Scene()


def nowhere() -> Scene:
    """No ground: the floor is a kilometre below, out of reach of a robot on a fixed base."""
    return Scene(floor=-1000.0)


def step(height: float, distance: float, depth: float = 1.5) -> Scene:
    """A step of ``height`` [m] whose front edge is ``distance`` [m] ahead of the origin, and whose
    back edge is ``depth`` [m] further ahead."""
    return Scene(boxes=(Box((distance, distance + depth), (-0.75, 0.75), height, 0.0),))


def platform(height: float, edge: float) -> Scene:
    """A platform that the robot starts on, ``height`` [m] above the floor. Its edge is ``edge`` [m]
    ahead of the origin, or behind it if that is negative."""
    x = (edge - 0.6, edge) if edge >= 0.0 else (edge, edge + 0.6)
    return Scene(-height, (Box(x, (-0.4, 0.4), 0.0, -height),))


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

    def build(self) -> Scene:
        """The ground these parameters describe."""
        return Scene(self.floor, tuple(Box(b.x, b.y, b.top, b.bottom) for b in self.boxes))
