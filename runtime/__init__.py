"""What runs a graph: signals, blocks, loading, schedule, executor, clocks, test bench."""
