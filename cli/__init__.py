"""The command line: ``aloft VERB``. One file a verb; heavy imports only inside the verbs."""

from .app import app, main

__all__ = ["app", "main"]
