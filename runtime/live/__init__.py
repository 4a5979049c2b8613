"""View of a running graph for other processes, and the page on which users see and tune it."""
