"""Execution of a graph: memory, ticks, life cycle, clocks, and the record of a run."""
