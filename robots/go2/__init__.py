"""Unitree Go2: what its URDF lacks, as one data file."""
