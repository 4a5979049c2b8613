"""What tests of optional libraries share: they are skipped where one is not there."""

from importlib.util import find_spec

import pytest


def needs(*names: str) -> None:
    """Skip all tests of a module unless these libraries are there. None is imported: every worker collects
    all tests, and would import all libraries."""
    for name in names:
        if find_spec(name) is None:
            pytest.skip(f"the library {name} is not installed", allow_module_level=True)
