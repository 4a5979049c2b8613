"""Diagram of the extension `studio`."""
