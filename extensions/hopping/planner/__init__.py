"""Plans the next jump while the robot moves, from a file of plans of its neighbours."""
