"""What is seen and kept: recordings of runs."""
