"""Blocks for jumps: references from plans, the phase of a jump, and the landing heuristic."""
