"""Cli of the extension `export`."""
