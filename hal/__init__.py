"""What touches the world: the robot interface and the simulator."""
