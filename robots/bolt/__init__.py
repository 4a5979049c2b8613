"""Bolt: what its URDF lacks, as one data file."""
