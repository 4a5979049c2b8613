"""Export of a graph or a sub-graph as a Functional Mock-up Unit (FMI 3.0, co-simulation)."""
