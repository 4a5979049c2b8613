"""Live of the extension `studio`."""
