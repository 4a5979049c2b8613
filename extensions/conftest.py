"""The fixtures of all tests."""

from tests.conftest import build, docs_script, source_distribution, tracked_files, wheel

__all__ = ["build", "docs_script", "source_distribution", "tracked_files", "wheel"]
