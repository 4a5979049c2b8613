"""Spreads a checked graph over machines: who runs what, and what must travel between them."""
