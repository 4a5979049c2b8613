"""The paper's figures, redrawn from our own runs: ``aloft study paper``."""
