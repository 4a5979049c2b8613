"""Random jumping tasks, planned and run in closed loop."""
