"""Pages of the extension `lab`."""
