"""What others may see of a graph while it runs, and the page on which they see and tune it."""
