"""Links between the parts of a graph that run on several machines."""
