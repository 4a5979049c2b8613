"""What runs a graph: memory, ticks, life cycle, clocks, and what is kept of a run."""
