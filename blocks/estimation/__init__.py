"""Blocks that estimate the state of the robot: contacts, pose and velocity."""
