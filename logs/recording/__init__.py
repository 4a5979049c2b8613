"""Recording of a run while it goes on, or after its end."""
