"""A module that fails when it is imported."""

raise RuntimeError("the sensor library is not installed")
