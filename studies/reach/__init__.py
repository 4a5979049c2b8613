"""How far a robot jumps in every direction: what is planned, what lands, and what the motors could give."""
