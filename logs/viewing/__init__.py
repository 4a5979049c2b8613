"""What a recording shows: the robot in 3D, its states, and time series."""
