"""Unitree G1: what its URDF lacks, as one data file."""
