"""Jumps that nobody chose: random tasks, planned and run in closed loop."""
