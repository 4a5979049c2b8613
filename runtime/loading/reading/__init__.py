"""The first stage: files as their authors wrote them, as trees in which everything has its place."""
