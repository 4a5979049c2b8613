"""What a block is: signals, units, parameters, ports, and the stages a graph goes through."""
