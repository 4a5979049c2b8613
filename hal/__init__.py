"""Everything that touches the world: the robot interface, the simulator, drivers, their twins."""
