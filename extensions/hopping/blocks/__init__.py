"""Blocks of the extension `hopping`."""
