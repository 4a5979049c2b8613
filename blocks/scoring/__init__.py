"""Blocks that judge a run by the simulation truth."""
