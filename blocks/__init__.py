"""The blocks that ship with aloft: what computes. One block, one file."""
