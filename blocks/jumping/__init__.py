"""Blocks that know what a jump is: plans, phases, landing."""
