"""Blocks that judge a run from what only a simulator knows."""
