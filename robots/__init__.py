"""What a robot is: its description, kinematics and rigid-body models, and the robots that ship."""
