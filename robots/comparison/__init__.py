"""Compares an imported robot with what two programs that nobody here wrote read from the same file."""
