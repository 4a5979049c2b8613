"""aloft: a block-diagram control framework for robots that leave the ground."""

__version__ = "0.1.0"
