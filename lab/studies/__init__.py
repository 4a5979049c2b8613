"""Studies of the extension `lab`."""
