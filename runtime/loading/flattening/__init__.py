"""The second stage: one graph, with includes and sub-graphs expanded and overrides applied."""
