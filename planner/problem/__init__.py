"""Jumps as optimisation problems: the formulations, their variables, rows and first guesses."""
