"""Rehearsal of plans: jumps are run, and the corrections that they teach are stored beside the plan."""
