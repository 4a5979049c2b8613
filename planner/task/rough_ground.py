"""Ground that nobody chose: for a row of jumps, levels and gaps drawn by a seed.

repeat: 10
distance_x: 14 cm
rough: {seed: 1, steps: 3 cm, gaps: 6 cm}
"""

from __future__ import annotations

import random
from collections.abc import Sequence

from ...runtime.language.parameters import Parameters, parameter
from .sequence import Hop


class RoughGround(Parameters):
    """How uneven the ground under a row of jumps is. Every number is uniform and independent."""

    seed: int = parameter(0, ge=0, le=2**31, text="what the ground is drawn by")
    steps: float = parameter(
        0.0, unit="m", ge=0.0, le=0.2,
        text="each landing is at most so much higher or lower than the start",
    )  # fmt: skip
    gaps: float = parameter(
        0.0, unit="m", ge=0.0, le=0.5,
        text="widest gap in the ground under a jump, which is longer by the gap",
    )  # fmt: skip

    def under(self, hops: Sequence[Hop]) -> tuple[Hop, ...]:
        """The jumps over that ground: with its steps and gaps, longer by the gap and higher by the
        step up, so that each clears its landing by as much as on level ground."""
        # Python's own generator, whose numbers are the same in every version and on every machine.
        draw, level, found = random.Random(self.seed), 0.0, list[Hop]()
        for hop in hops:
            landing = round(draw.uniform(-self.steps, self.steps), 3)
            gap = round(draw.uniform(0.0, self.gaps), 3)
            step, ahead = round(landing - level, 3), hop.distance_x or 0.0
            longer = ahead + (gap if ahead >= 0.0 else -gap)
            changed = {"landing_height": step, "gap": gap, "distance_x": round(longer, 6)}
            if hop.rise is not None:
                changed["rise"] = round(hop.rise + max(0.0, step), 6)
            found.append(hop.model_copy(update=changed))
            level = landing
        return tuple(found)
