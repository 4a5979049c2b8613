"""The blocks that ship with aloft, each in a file of its own."""
