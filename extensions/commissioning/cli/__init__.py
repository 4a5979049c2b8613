"""Cli of the extension `commissioning`."""
