"""What ``aloft plan`` shows, the grids that it plans, and rehearsals of plans."""
