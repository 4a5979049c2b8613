"""Reads robots from URDF and MJCF files, with what a short YAML beside them adds."""
