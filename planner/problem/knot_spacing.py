"""How the knots of a phase are spread over its time.

Where forces and legs move fast, at lift-off and around touchdown, intervals are short; where the
robot squats or comes to rest they are long. Each function gives the intervals' lengths as multiples
of the phase's mean.
"""

from __future__ import annotations

import numpy as np

from ...blocks.signals import Phase
from ...mathematics.arrays import Array

GROWTH = {Phase.SQUAT: 0.5, Phase.THRUST: 0.4, Phase.LANDING: 5.0}
"""The last interval's length by the first's."""
GROWTH_BETWEEN = 2.0
"""The same for a landing that leads to another jump."""
FLIGHT_MIDDLE = 4.0
"""The length of an interval in the middle of the flight by one at its ends."""


def spacing(phase: Phase, count: int, *, last: bool = True) -> Array:
    """Interval lengths (count,) with a mean of one; ``last`` says that no jump follows."""
    place = (np.arange(count) + 0.5) / count
    if phase is Phase.FLIGHT:
        lengths = 1.0 + (FLIGHT_MIDDLE - 1.0) * np.sin(np.pi * place)
    else:
        growth = GROWTH[phase]
        if phase is Phase.LANDING and not last:
            growth = GROWTH_BETWEEN
        lengths = growth**place
    return np.asarray(lengths * count / lengths.sum())
