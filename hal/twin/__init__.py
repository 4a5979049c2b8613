"""A robot's twin: devices that speak the real protocols byte for byte, on pseudo-terminals."""
