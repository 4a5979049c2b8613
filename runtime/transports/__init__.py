"""What carries messages between machines, one class for each protocol."""
