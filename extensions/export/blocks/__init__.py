"""Blocks of the extension `export`."""
