"""Demo of the extension `export`."""
