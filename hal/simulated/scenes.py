"""Scenes: the ground the robot stands and lands on: a floor, boxes, stairs, tiles and height fields.

The world's origin is the ground point midway between the soles where the robot starts, so the
surface there is at z = 0 in every scene.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Self

import numpy as np
from pydantic import model_validator

from ...mathematics.elementary import cos, sincos
from ...robots.terrain import Ground, HeightField, Terrain
from ...runtime.language.parameters import Parameters, parameter
from .tiles import TileParameters

Interval = tuple[float, float]

MAX_CORNERS = 400
"""The most rows or columns of a height field."""
CORNERS_OF_A_WAVE = 12
"""Number of corners of a height field along a wave's length."""


def flat() -> Terrain:
    """Return a level floor."""
    return Terrain()


def no_ground() -> Terrain:
    """No ground: the floor is a kilometre below, out of reach of a robot on a fixed base."""
    return Terrain(floor=-1000.0)


def step(height: float, distance: float, depth: float = 1.5) -> Terrain:
    """Return a step of ``height`` [m] whose front edge is ``distance`` [m] ahead of the origin, and whose back edge is
    ``depth`` [m] further ahead."""
    return Terrain(blocks=(Ground((distance, -0.75, 0.0), (distance + depth, 0.75, height)),))


def platform(height: float, edge: float) -> Terrain:
    """Return a platform that the robot starts on, ``height`` [m] above the floor. Its edge is ``edge`` [m] ahead of the
    origin, or behind it if that is negative."""
    back, front = (edge - 0.6, edge) if edge >= 0.0 else (edge, edge + 0.6)
    return Terrain(-height, (Ground((back, -0.4, -height), (front, 0.4, 0.0)),))


class PieceParameters(Parameters):
    """Material of a piece of ground."""

    friction: float | None = parameter(
        None, gt=0, text="its friction coefficient; none: that of the scene"
    )
    stiffness: float = parameter(
        1.0, ge=0.01, le=100.0, text="factor on the scene's stiffness of contacts"
    )


class BoxParameters(PieceParameters):
    """A box, as a graph describes it."""

    x: Interval = parameter(text="from, to; ahead of where the robot starts", unit="m")
    y: Interval = parameter((-0.75, 0.75), unit="m", text="from, to; to the left of it")
    top: float = parameter(text="height of the middle of its upper face", unit="m")
    bottom: float = parameter(0.0, unit="m", text="height of its lower face")
    slope: Interval = parameter(
        (0.0, 0.0), unit="rad", text="angles by which its upper face rises ahead and to the left"
    )

    @model_validator(mode="after")
    def _check_extent(self) -> Self:
        for name, (low, high) in (("x", self.x), ("y", self.y), ("z", (self.bottom, self.top))):
            if not low < high:
                raise ValueError(f"a box must have an extent along {name}: {low:g} to {high:g} m")
        check_slope(max(map(abs, self.slope)))
        return self

    def build(self) -> Ground:
        """Return the box."""
        return Ground(
            (self.x[0], self.y[0], self.bottom), (self.x[1], self.y[1], self.top),
            self.slope, self.friction, self.stiffness,
        )  # fmt: skip


class StairParameters(PieceParameters):
    """Stairs that lead ahead, up or down."""

    x: float = parameter(text="the first edge; ahead of where the robot starts", unit="m")
    y: Interval = parameter((-0.75, 0.75), unit="m", text="from, to; to the left of it")
    rise: float = parameter(text="height of each step; negative: they lead down", unit="m")
    run: float = parameter(text="depth of each step", unit="m", gt=0)
    steps: int = parameter(text="number of steps", ge=1, le=100)
    landing: float = parameter(1.0, unit="m", gt=0, text="depth of the last step")

    def build(self, floor: float) -> tuple[Ground, ...]:
        """Return a box for each step that is above the floor."""
        found = []
        for k in range(self.steps):
            start, top = self.x + k * self.run, (k + 1) * self.rise
            end = start + (self.landing if k + 1 == self.steps else self.run)
            if top > floor:
                least, most = (start, self.y[0], floor), (end, self.y[1], top)
                found.append(Ground(least, most, (0.0, 0.0), self.friction, self.stiffness))
        return tuple(found)


class FieldParameters(PieceParameters):
    """A height field: heights over a grid, with straight edges between neighbours."""

    x: Interval = parameter(text="from, to; ahead of where the robot starts", unit="m")
    y: Interval = parameter((-0.75, 0.75), unit="m", text="from, to; to the left of it")
    top: float = parameter(0.0, unit="m", text="added to all heights")
    heights: list[list[float]] | None = parameter(
        None, unit="m", text="rows from right to left, each with heights from behind to ahead"
    )
    picture: str | None = parameter(
        None,
        text="a PNG, grey from 0 at black to `height` at white; its top is left, its right is ahead",
    )
    rubble: float | None = parameter(
        None, unit="m", gt=0, text="spacing of corners with drawn heights from 0 to `height`"
    )
    waves: float | None = parameter(
        None, unit="m", gt=0, text="length of waves between 0 and `height`"
    )
    heading: float = parameter(0.0, unit="rad", text="direction of the waves, 0: ahead")
    height: float = parameter(0.02, unit="m", gt=0, text="of rubble, waves or white")
    seed: int = parameter(0, ge=0, text="of the rubble")

    @model_validator(mode="after")
    def _check_heights(self) -> Self:
        kinds = ("heights", "picture", "rubble", "waves")
        given = [kind for kind in kinds if getattr(self, kind) is not None]
        if len(given) != 1:
            raise ValueError(
                f"a field needs one of {', '.join(kinds)}; given: {', '.join(given) or 'none'}"
            )
        for name, (low, high) in (("x", self.x), ("y", self.y)):
            if not low < high:
                raise ValueError(f"a field must have an extent along {name}: {low:g} to {high:g} m")
        heights = self._heights()
        rows, columns = len(heights), len(heights[0]) if heights else 0
        if any(len(row) != columns for row in heights):
            raise ValueError("all rows of `heights` must have as many numbers")
        if not (2 <= rows <= MAX_CORNERS and 2 <= columns <= MAX_CORNERS):
            raise ValueError(
                f"a field has 2 to {MAX_CORNERS} rows and columns, not {rows} and {columns}"
            )
        return self

    def build(self) -> HeightField:
        """Return the field."""
        heights = tuple(tuple(round(self.top + z, 6) for z in row) for row in self._heights())
        (x0, x1), (y0, y1) = self.x, self.y
        return HeightField((x0, y0), (x1, y1), heights, self.friction, self.stiffness)

    def _heights(self) -> list[list[float]]:
        """Rows from the least y, each from the least x [m]."""
        if self.heights is not None:
            return self.heights
        if self.picture is not None:
            return read_picture(Path(self.picture), self.height)
        spacing = self.rubble or self.waves / CORNERS_OF_A_WAVE  # type: ignore[operator]
        sides = self.x[1] - self.x[0], self.y[1] - self.y[0]
        columns, rows = (max(2, round(side / spacing) + 1) for side in sides)
        if self.rubble is not None:
            draws = np.random.default_rng([self.seed, rows, columns]).random((rows, columns))
            heights: list[list[float]] = (self.height * draws).tolist()
            return heights
        assert self.waves is not None
        left, ahead = sincos(self.heading)
        xs, ys = np.linspace(*self.x, columns).tolist(), np.linspace(*self.y, rows).tolist()
        number = 2.0 * math.pi / self.waves
        return [
            [0.5 * self.height * (1.0 - cos(number * (ahead * x + left * y))) for x in xs]
            for y in ys
        ]


def read_picture(file: Path, height: float) -> list[list[float]]:
    """Return the heights [m] of a picture's pixels: rows from its lowest, black is 0, white is ``height``.

    Raises:
        ValueError: there is no such picture, or it cannot be read.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(file) as picture:
            deep = picture.mode.startswith("I")  # 16 bits
            grey = np.asarray(picture if deep else picture.convert("L"), dtype=np.float64)
    except (OSError, UnidentifiedImageError) as error:
        raise ValueError(f"picture {file} cannot be read: {error}") from None
    heights: list[list[float]] = (height / (65535.0 if deep else 255.0) * grey[::-1]).tolist()
    return heights


def check_slope(angle: float) -> None:
    """Refuse ground that is too steep to be a floor.

    Raises:
        ValueError: the angle [rad] is more than 45 degrees.
    """
    if angle > 0.25 * math.pi:
        raise ValueError(f"ground leans by up to 45 deg, not by {math.degrees(angle):.0f} deg")


class SceneParameters(Parameters):
    """Ground that a graph describes by itself: a level floor, and boxes, stairs, tiles and height
    fields on it."""

    floor: float = parameter(0.0, unit="m", text="height of the floor")
    boxes: tuple[BoxParameters, ...] = parameter((), text="solid blocks, level or leaning")
    stairs: tuple[StairParameters, ...] = parameter((), text="stairs ahead")
    fields: tuple[FieldParameters, ...] = parameter((), text="height fields")
    tiles: tuple[TileParameters, ...] = parameter((), text="areas of drawn tiles")
    uneven: float | None = parameter(
        None, unit="m", ge=0,
        text="largest distance from the ground of the task, for the score; none: as far as leaning boxes, tiles and fields rise or sink",
    )  # fmt: skip

    @model_validator(mode="after")
    def _check_floor(self) -> Self:
        for number, field in enumerate(self.fields):
            lowest = field.build().lowest
            if lowest < self.floor:
                raise ValueError(
                    f"fields.{number} reaches down to {lowest:g} m, and the floor at {self.floor:g} m "
                    f"covers it; set floor: {lowest - 0.01:.3g} m, or top: {self.floor - lowest:.3g} m more"
                )
        return self

    def build(self, seed: int = 0) -> Terrain:
        """Build the ground these parameters describe; tiles without a seed of their own are drawn by ``seed``."""
        blocks = [box.build() for box in self.boxes]
        fields = tuple(field.build() for field in self.fields)
        uneven = max((block.rise for block in blocks), default=0.0)
        for stairs in self.stairs:
            blocks += stairs.build(self.floor)
        for area in self.tiles:
            blocks += area.build(seed)
            uneven = max(uneven, area.height)
        for field in fields:
            uneven = max(uneven, field.highest - field.lowest)
        uneven = uneven if self.uneven is None else self.uneven
        return Terrain(self.floor, tuple(blocks), fields, uneven)
