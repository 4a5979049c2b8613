"""A module with a mistake in Python's grammar, made so that this file itself has none."""

compile("\n\nclass Broken(:\n", __file__, "exec")
