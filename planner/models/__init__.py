"""Models of the robot that the planner works with, symbolic and exact."""
