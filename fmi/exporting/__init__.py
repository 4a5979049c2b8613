"""Makes a Functional Mock-up Unit (FMI 3.0, co-simulation) of a graph or of a sub-graph."""
