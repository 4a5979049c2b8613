"""Descriptions of robots, their kinematics and rigid-body models, and the robots that ship."""
