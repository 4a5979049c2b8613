"""Kernels as machine code: a kernel and its arrays become one call, compiled once per machine."""
