"""Recordings for other programs, and the differences between two of them."""
