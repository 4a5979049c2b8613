"""The cost of links between machines, and jumps over links that take their time."""
