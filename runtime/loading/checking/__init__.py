"""The third stage: all that can be wrong with a flat graph, and the checked graph."""
