"""The command line, ``aloft VERB``. Every verb has a file; heavy imports are inside the verbs only."""

from .app import main, make_app

__all__ = ["main", "make_app"]
