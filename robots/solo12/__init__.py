"""Solo12: what its URDF lacks, as one data file."""
