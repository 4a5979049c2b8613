"""The command line, ``aloft VERB``. Every verb has a file; heavy imports are inside the verbs only."""

from .app import app, main

__all__ = ["app", "main"]
