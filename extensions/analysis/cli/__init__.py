"""Cli of the extension `analysis`."""
