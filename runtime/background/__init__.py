"""Blocks that compute beside the control thread and answer after a declared latency."""
