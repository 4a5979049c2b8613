"""Views of a recording: the robot in 3D, its states, and time series."""
