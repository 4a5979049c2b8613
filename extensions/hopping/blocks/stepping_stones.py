"""Ground of stones, and the command to jump to the next one."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Self

import numpy as np
from pydantic import model_validator

from ....mathematics.arrays import Array2D
from ....mathematics.kernel import kernel
from ....runtime.language.block import Block, Context, Input, Output, State
from ....runtime.language.parameters import Parameters, parameter
from ....runtime.language.signals import Field, Signal
from ..signals import STONES_SEEN, JumpCommand, PlanRequest, SeenStones

Interval = tuple[float, float]
CLOSE = 1e-3
"""Stones of one course are at least so far apart [m]."""


class StoneParameters(Parameters):
    """One stone: a box with level sides along the axes of the world. The middle of the feet should land on its middle."""

    x: float = parameter(unit="m", text="of its middle, ahead of where the robot starts")
    y: float = parameter(0.0, unit="m", text="of its middle, to the left")
    top: float = parameter(0.0, unit="m", ge=-1.0, le=5.0, text="its height")
    size: Interval | None = parameter(
        None, unit="m", text="its extent ahead and aside; none: that of all stones"
    )


class RandomStones(Parameters):
    """Stones that are drawn: each is ahead of the one before. All draws are uniform and independent."""

    count: int = parameter(10, ge=1, le=200, text="number of stones")
    seed: int = parameter(0, ge=0, le=2**31, text="seed of the random draws")
    gap: Interval = parameter(
        (0.02, 0.14), unit="m", text="least and greatest gap between a stone and the next one"
    )
    aside: float = parameter(
        0.03, unit="m", ge=0.0, le=0.3, text="no stone is further to the side of the one before"
    )
    height: float = parameter(
        0.0, unit="m", ge=0.0, le=0.3, text="none is higher or lower than the one before by more"
    )

    def draw(self, depth: float) -> tuple[StoneParameters, ...]:
        """Draw the stones, each ``depth`` [m] from its front to its back edge; the robot stands on one before the first
        of them."""
        rng = np.random.default_rng(self.seed)
        x = y = top = 0.0
        found = []
        for _ in range(self.count):
            x += depth + rng.uniform(*self.gap)
            y += rng.uniform(-self.aside, self.aside)
            top += rng.uniform(-self.height, self.height)
            found.append(StoneParameters(x=round(x, 4), y=round(y, 4), top=round(top, 4)))
        return tuple(found)


class SteppingStonesParameters(Parameters):
    """Places of the stones."""

    stones: tuple[StoneParameters, ...] = parameter((), text="the stones, in order; none: `random`")
    random: RandomStones = parameter(RandomStones, text="parameters of their random draws")
    size: Interval = parameter((0.12, 0.20), unit="m", text="extent of a stone ahead and aside")
    start: Interval = parameter(
        (0.30, 0.40), unit="m",
        text="extent behind and aside of the one on which the robot starts, whose front edge is that of a stone",
    )  # fmt: skip
    depth: float = parameter(
        0.10, unit="m", gt=0.0, le=5.0, text="depth of the floor below the lowest stone"
    )
    seen: int = parameter(
        1, ge=1, le=STONES_SEEN, text="number of stones seen ahead; the robot jumps to the first"
    )

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        low, high = self.random.gap
        if not 0.0 < low <= high:
            raise ValueError(f"gap must be two positive lengths in rising order: {self.random.gap}")
        placed = self.boxes()
        for number, (one, other) in enumerate(pairwise(placed)):
            apart = any(
                other[axis][0] - one[axis][1] >= CLOSE or one[axis][0] - other[axis][1] >= CLOSE
                for axis in ("x", "y")
            )
            if not apart:
                raise ValueError(
                    f"stone {number + 1} overlaps the one before it: it covers x {other['x']}, y {other['y']} m, and "
                    f"that one x {one['x']}, y {one['y']} m; move it"
                )
        return self

    def placed(self) -> tuple[StoneParameters, ...]:
        """All stones, those given or those drawn."""
        return self.stones or self.random.draw(self.size[0])

    def boxes(self) -> list[dict[str, Any]]:
        """Return the stone on which the robot starts and all others, as the boxes of a scene."""
        stones = self.placed()
        floor = min(0.0, *(stone.top for stone in stones)) - self.depth
        front, half = 0.5 * self.size[0], 0.5 * self.start[1]
        found = [{"x": (-self.start[0], front), "y": (-half, half), "top": 0.0, "bottom": floor}]
        for stone in stones:
            along, across = (0.5 * side for side in stone.size or self.size)
            found.append(
                {
                    "x": (round(stone.x - along, 6), round(stone.x + along, 6)),
                    "y": (round(stone.y - across, 6), round(stone.y + across, 6)),
                    "top": stone.top,
                    "bottom": floor,
                }
            )
        return found


class StonesTaken(Signal):
    """The state of ``SteppingStones``."""

    given = Field(dtype="int64", text="number of stones that have been commanded so far")


class SteppingStones(Block):
    """Commands a jump to each stone in turn, and knows the ground that they make.

    The next stone is commanded when the robot has landed and taken the one before (``taken`` is the request of
    ``SteeredPlan``). ``seen`` holds the next stones, for a planner that looks further ahead. Stones are
    ``placed`` commands: their places are those of the world, and do not depend on where earlier jumps have landed.

    The robot takes its ground from here, so stones are given once: ``robot.ground.scene: {from: commands.scene}``.
    It begins on a larger stone. Between the stones there is nothing to stand on.

    The robot takes the heights as given; nothing measures them.
    """

    Params = SteppingStonesParameters
    params: SteppingStonesParameters

    @classmethod
    def exported_values(cls, params: Parameters, context: Context) -> Mapping[str, Any]:
        """Export the ``count`` of stones, and the ``scene`` that they make."""
        assert isinstance(params, cls.Params)
        boxes = params.boxes()
        return {"count": len(boxes) - 1, "scene": {"floor": boxes[0]["bottom"], "boxes": boxes}}

    taken = Input(PlanRequest, text="the last request, by the number of its command")
    command = Output(JumpCommand, text="the next stone; number zero: none yet")
    seen = Output(SeenStones, text="the stones ahead")
    memory = State(StonesTaken, text="number of stones commanded")

    def setup(self) -> None:
        self.rows = np.array([[s.x, s.y, s.top] for s in self.params.placed()], dtype=np.float64)

    @kernel
    @staticmethod
    def step(
        taken: PlanRequest,
        command: JumpCommand,
        seen: SeenStones,
        memory: StonesTaken,
        rows: Array2D,
        params: SteppingStonesParameters,
    ) -> None:
        if memory.given < rows.shape[0] and taken.command >= memory.given:
            memory.given += 1
        last = memory.given - 1
        command.number, command.placed, command.replaces = memory.given, True, False
        command.ahead, command.aside = rows[last, 0], rows[last, 1]
        command.turn, command.up = 0.0, rows[last, 2]
        seen.count = min(params.seen, rows.shape[0] - last)
        seen.place[:] = 0.0
        for k in range(seen.count):
            seen.place[k, :] = rows[last + k]
