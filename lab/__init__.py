"""Benchmarks, figures and pages of the project itself; in a checkout only."""
