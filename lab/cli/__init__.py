"""Cli of the extension `lab`."""
