"""The simple humanoid: what its URDF lacks, as one data file."""
