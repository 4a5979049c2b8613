"""What is tried to break runs: late ticks, damaged caches, warm motors, IMUs with wrong units; ``python -m aloft.lab.robustness``."""
