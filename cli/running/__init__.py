"""The ways in which ``aloft run`` runs a graph, and how its result is printed."""
