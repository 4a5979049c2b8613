"""What is tried to break runs: late ticks, damaged caches, warm motors, wrong sensors, bad links; see ``all``."""
