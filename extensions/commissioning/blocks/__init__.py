"""Blocks of the extension `commissioning`."""
