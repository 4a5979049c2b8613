"""How ``aloft study`` and ``aloft tune`` make runs and show them, and the paper's figures."""
