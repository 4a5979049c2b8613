"""Ground of tiles: each has a drawn size, height, slope and friction."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Self

import numpy as np
from pydantic import model_validator

from ...robots.description import RobotDescription
from ...robots.kinematics import ball_feet, standing_contacts
from ...robots.terrain import Ground, Terrain
from ...runtime.language.parameters import Parameters, parameter

Interval = tuple[float, float]
Area = tuple[Interval, Interval]
"""Bounds of x and of y [m], each from and to."""

THICKNESS = 0.02
"""Depth of a tile below the least height of its area [m]."""


class TileKind(Parameters):
    """Differences of tiles from a level floor."""

    size: Interval = parameter((0.1, 0.2), unit="m", text="least and greatest side of a tile")
    height: float = parameter(
        0.01, unit="m", ge=0, le=0.2, text="no point of a tile is further above or below the mean"
    )
    slope: float = parameter(
        math.radians(5.0), unit="rad", ge=0, le=0.5, text="no tile leans by more, in any direction"
    )
    friction: Interval | None = parameter(
        (0.4, 1.0), text="least and greatest coefficient of a tile; none: that of the scene"
    )
    stiffness: float = parameter(
        1.0, ge=1.0, le=16.0,
        text="a tile's factor on the stiffness of contacts is log-uniform between its inverse and this",
    )  # fmt: skip

    @model_validator(mode="after")
    def _check_spans(self) -> Self:
        if not 0.02 <= self.size[0] <= self.size[1]:
            raise ValueError(f"size must be two lengths from 2 cm on, in rising order: {self.size}")
        if self.friction is not None and not 0.0 < self.friction[0] <= self.friction[1]:
            raise ValueError(
                f"friction must be two positive numbers in rising order: {self.friction}"
            )
        return self

    def lay(self, area: Area, top: float, rng: np.random.Generator) -> Iterator[Ground]:
        """Return the tiles of an area whose mean height is ``top`` [m]."""
        for x in self._divide(area[0], rng):
            for y in self._divide(area[1], rng):
                yield self._tile(x, y, top, rng)

    def _divide(self, span: Interval, rng: np.random.Generator) -> Iterator[Interval]:
        """Parts of a span with sides from ``size``; the last one is what is left."""
        start, end = span
        while end - start > 1e-9:
            side = float(rng.uniform(*self.size))
            stop = end if end - start < side + 0.5 * self.size[0] else start + side
            yield start, stop
            start = stop

    def _tile(self, x: Interval, y: Interval, top: float, rng: np.random.Generator) -> Ground:
        lean, heading, place, grip, give = rng.random(5).tolist()
        slope = [
            math.tan(self.slope * lean) * f(2.0 * math.pi * heading) for f in (math.cos, math.sin)
        ]
        rise = 0.5 * (abs(slope[0]) * (x[1] - x[0]) + abs(slope[1]) * (y[1] - y[0]))
        if rise > self.height:
            slope = [self.height / rise * each for each in slope]
            rise = self.height
        z = top + (self.height - rise) * (2.0 * place - 1.0)
        friction = None
        if self.friction is not None:
            friction = self.friction[0] + grip * (self.friction[1] - self.friction[0])
        return Ground(
            (x[0], y[0], top - self.height - THICKNESS), (x[1], y[1], z), (math.atan(slope[0]), math.atan(slope[1])),
            friction, self.stiffness ** (2.0 * give - 1.0),
        )  # fmt: skip


class TileParameters(TileKind):
    """An area of tiles, as a graph describes it."""

    x: Interval = parameter(text="from, to; ahead of where the robot starts", unit="m")
    y: Interval = parameter((-0.75, 0.75), unit="m", text="from, to; to the left of it")
    top: float = parameter(unit="m", text="mean height of the tiles")
    seed: int | None = parameter(None, ge=0, text="seed of the tiles; none: the robot's seed")

    @model_validator(mode="after")
    def _check_extent(self) -> Self:
        for name, (low, high) in (("x", self.x), ("y", self.y)):
            if not low < high:
                raise ValueError(f"tiles must have an extent along {name}: {low:g} to {high:g} m")
        return self

    def build(self, seed: int) -> tuple[Ground, ...]:
        """Return the tiles."""
        rng = np.random.default_rng([STREAM, seed if self.seed is None else self.seed])
        return tuple(self.lay((self.x, self.y), self.top, rng))


STREAM = 30
"""The number of the tiles' random numbers beside those of ``random_streams.Purpose``."""


class UnevenParameters(TileKind):
    """Tiles on all level ground of a scene that only the simulator knows of, drawn by the robot's seed.

    Floor and boxes sink by ``height`` below their tiles. The robot stands on a level tile at the start.
    """

    reach: float = parameter(
        1.5,
        unit="m",
        gt=0,
        le=10.0,
        text="distance from the start up to which there are tiles on the floor",
    )
    margin: float = parameter(
        0.01,
        unit="m",
        ge=0,
        text="margin of the level tile around what touches the ground: contact points, or ball feet",
    )

    def cover(self, scene: Terrain, robot: RobotDescription | None, seed: int) -> Terrain:
        """Return the scene with its floor and its level boxes under tiles."""
        rng = np.random.default_rng([STREAM, seed])
        start = self._start(robot)
        areas = [(-self.reach, self.reach)] * 2
        tiles, blocks = [], []
        for tile in self._around(start, (areas[0], areas[1]), scene.floor, rng):
            if not any(_covers(block, tile) for block in scene.blocks):
                tiles.append(tile)
        for block in scene.blocks:
            low, high = block.least, block.most
            area = (low[0], high[0]), (low[1], high[1])
            if not block.level:
                blocks.append(block)
                continue
            tiles += self._around(start, area, high[2], rng)
            if high[2] - self.height > low[2]:
                blocks.append(
                    Ground(low, (high[0], high[1], high[2] - self.height), block.slope,
                           block.friction, block.stiffness)
                )  # fmt: skip
        return Terrain(
            scene.floor - self.height, (*blocks, *tiles), scene.fields, scene.uneven + self.height
        )

    def _start(self, robot: RobotDescription | None) -> Area:
        """Return the rectangle on which the robot stands at the start."""
        if robot is None or not robot.contacts:
            return (-0.2, 0.2), (-0.2, 0.2)
        beyond = np.full(len(robot.contacts), self.margin)
        for ball in ball_feet(robot):
            # A tile that is higher by `height` would push a ball that stands nearer to it than this.
            above = max(ball.radius - self.height, 0.0)
            beyond[ball.point] += math.sqrt(ball.radius**2 - above**2)
        spans = []
        for place in standing_contacts(robot)[:, :2].T:
            spans.append((float((place - beyond).min()), float((place + beyond).max())))
        return spans[0], spans[1]

    def _around(
        self, start: Area, area: Area, top: float, rng: np.random.Generator
    ) -> Iterator[Ground]:
        """Tiles on an area, with a level one where the robot stands at the start, if that is there."""
        (x0, x1), (y0, y1) = area
        (a, b), (c, d) = (
            (max(low, s), min(high, e)) for (low, high), (s, e) in zip(area, start, strict=True)
        )
        if top != 0.0 or a >= b or c >= d:
            yield from self.lay(area, top, rng)
            return
        friction = None if self.friction is None else float(rng.uniform(*self.friction))
        yield Ground((a, c, -self.height - THICKNESS), (b, d, 0.0), (0.0, 0.0), friction)
        for part in (
            ((x0, a), (y0, y1)), ((b, x1), (y0, y1)), ((a, b), (y0, c)), ((a, b), (d, y1)),
        ):  # fmt: skip
            yield from self.lay(part, top, rng)


def _covers(block: Ground, tile: Ground) -> bool:
    """Check that no part of a tile is seen beside a box."""
    inside = all(block.least[k] <= tile.least[k] and tile.most[k] <= block.most[k] for k in (0, 1))
    return inside and block.most[2] > tile.most[2]
