"""Solves problems: compiles their functions, calls the solvers, and solves easier problems first where needed."""
