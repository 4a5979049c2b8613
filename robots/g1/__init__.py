"""BRUCE, the biped of the paper: its description as one data file."""
