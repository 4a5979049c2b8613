"""For tests of blocks and graphs: a bench for one block, conformance checks, counted arrays."""

from .bench import BlockBench

__all__ = ["BlockBench"]
