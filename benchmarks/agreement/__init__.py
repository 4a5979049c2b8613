"""Whether all methods for the whole-body program find the same minimum."""
