"""From a problem to its solution: compiled functions, solvers, easier problems first."""
