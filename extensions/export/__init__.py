"""Graphs and parts of them as C libraries and FMUs, and compiled libraries as blocks."""
