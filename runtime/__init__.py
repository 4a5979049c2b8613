"""The runtime: what a block is, loading a graph from YAML, running it, and testing blocks."""
