"""What a recorded run says about a robot: its mass, its torso, its friction, its delay."""
