"""Settings for all tests."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).parent.parent
UNTRACKED = ("recordings", "build", "dist", "aloft.egg-info", "__pycache__", ".*")

# The same examples every time: what passes here passes there. No deadline: machines are shared.
settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel built from a copy of the tracked files, so nothing here is touched."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "some-folder"
    shutil.copytree(ROOT, source, ignore=shutil.ignore_patterns(*UNTRACKED, "scripts"))
    code = f"from setuptools import build_meta; build_meta.build_wheel({str(folder)!r})"
    subprocess.run([sys.executable, "-c", code], cwd=source, check=True, capture_output=True)
    (built,) = folder.glob("*.whl")
    return built
