"""Tools for tests of blocks and graphs: a bench for one block, a conformance suite for any block,
and a counter of allocated arrays."""

from .allocations import count_array_allocations
from .bench import BlockBench
from .conformance import ConformanceError, check_block, conformance_cases
from .graphs import BlockUse, checked_graph
from .stretch import Stretch, StretchError

__all__ = [
    "BlockBench",
    "BlockUse",
    "ConformanceError",
    "Stretch",
    "StretchError",
    "check_block",
    "checked_graph",
    "conformance_cases",
    "count_array_allocations",
]
