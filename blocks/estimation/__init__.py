"""Blocks that find out where the robot is and how it moves."""
