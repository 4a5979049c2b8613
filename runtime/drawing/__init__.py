"""Draws a graph as a block diagram: blocks with their ports, and wires between them."""
