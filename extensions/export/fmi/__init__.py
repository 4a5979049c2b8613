"""Functional Mock-up Units (FMI 2.0 and 3.0, co-simulation): as blocks, and made of graphs."""
