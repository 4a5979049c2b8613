"""Cli of the extension `studio`."""
