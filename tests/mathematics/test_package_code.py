"""The digest of code follows every file in the folders that are named, and no other."""

from __future__ import annotations

from pathlib import Path

import pytest

from aloft.mathematics import package_code
from aloft.mathematics.package_code import code_digest


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "mathematics").mkdir()
    (tmp_path / "robots" / "parts").mkdir(parents=True)
    (tmp_path / "robots" / "parts" / "leg.py").write_text("a = 1\n")
    (tmp_path / "robots" / "robot.yaml").write_text("mass: 1\n")
    monkeypatch.setattr(package_code, "__file__", str(tmp_path / "mathematics" / "package_code.py"))
    return tmp_path


def digest(*folders: str) -> bytes:
    """As in a new process."""
    code_digest.cache_clear()
    return code_digest(*folders)


def test_a_changed_renamed_or_new_file_changes_it(package: Path) -> None:
    found = {digest("robots")}
    file = package / "robots" / "parts" / "leg.py"
    file.write_text("a = 2\n")
    found.add(digest("robots"))
    file.rename(file.with_name("arm.py"))
    found.add(digest("robots"))
    (package / "robots" / "new.py").write_text("")
    found.add(digest("robots"))
    assert len(found) == 4


def test_other_folders_and_files_do_not(package: Path) -> None:
    before = digest("robots")
    (package / "mathematics" / "other.py").write_text("b = 1\n")
    (package / "robots" / "robot.yaml").write_text("mass: 2\n")
    assert digest("robots") == before
    assert digest("robots", "mathematics") != before


def test_the_versions_of_libraries_are_part_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    before = digest("mathematics")
    monkeypatch.setattr(package_code.metadata, "version", lambda name: "0.0")
    assert digest("mathematics") != before
    code_digest.cache_clear()
