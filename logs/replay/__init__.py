"""Executes a recorded run again and compares it with the recording."""
