"""Speed as ratios to peers and hand-written loops, measured in one run.

``catalogue`` names all benchmarks. The file of each has its name, and lies beside its helpers in a
folder of its own where it has some.
"""
