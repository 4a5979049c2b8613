"""Blocks that talk to ROS 2 over Zenoh, without an installation of ROS."""
