"""Cli of the extension `hopping`."""
