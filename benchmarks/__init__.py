"""Speed as ratios to peers and hand-written loops, measured in one run."""
