"""A robot's reach in every direction: of plans, of jumps that land, and of the motors."""
