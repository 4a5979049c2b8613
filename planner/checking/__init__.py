"""Decides whether a robot may follow a plan, by exact dynamics and named tests."""
