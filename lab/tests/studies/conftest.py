"""The fixtures of all tests of studies."""

from tests.studies.conftest import folder, study

__all__ = ["folder", "study"]
