"""Identification of the extension `commissioning`."""
