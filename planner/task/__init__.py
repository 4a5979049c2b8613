"""Tasks: which jump is wanted, how a task is read, and which contradictions it may have."""
