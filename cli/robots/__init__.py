"""The verbs of ``aloft robot`` for a robot on a bench, and those that learn from its runs."""
