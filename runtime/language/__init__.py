"""Language of blocks: signals, units, parameters, ports, and the stages of a graph."""
