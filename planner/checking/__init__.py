"""Whether a plan may be handed to a robot: exact dynamics, and named tests."""
