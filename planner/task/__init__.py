"""What jump is asked for: the task, how it is read, and what of it contradicts itself."""
