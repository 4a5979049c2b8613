"""Rooms that can be taken away by deleting their folder; the core imports none of them."""
