"""Studies of the extension `analysis`."""
