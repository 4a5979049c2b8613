"""Transports, which carry messages between machines: one class for each protocol."""
