"""A folder with a graph whose runs are quick, and studies of it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from aloft.studies.reading import read_study
from aloft.studies.study import Study

from ..counting import copy_counting


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """``counter.py`` and ``count.yaml``, which is where commands run."""
    copy_counting(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def study(folder: Path) -> Callable[[str], Study]:
    """The study in a text; ``graph`` and ``seeds`` are added."""

    def read(text: str) -> Study:
        (folder / "study.yaml").write_text(f"graph: count.yaml\nseeds: 0:3\n{text}")
        return read_study(Path("study.yaml"))

    return read
