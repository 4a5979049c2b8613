"""What the tests of compiled kernels share."""

import pytest

from aloft.mathematics.compiling import compile_calls


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    """A cache of machine code that is empty, and nothing loaded."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(compile_calls, "_loaded", {})
    monkeypatch.setattr(compile_calls, "_names", {})
