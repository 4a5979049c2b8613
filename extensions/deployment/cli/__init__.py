"""Cli of the extension `deployment`."""
