"""Sensors: what each measures, its errors, and how simulator, packets, ROS 2 and viewer see it."""
