"""A log of a robot that plays the robot."""
