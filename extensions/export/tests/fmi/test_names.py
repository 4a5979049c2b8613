"""Archives and descriptions of strangers: names that lead out of their folder, and sizes."""

import zipfile
from pathlib import Path

import pytest

from aloft.extensions.export.fmi import instance
from aloft.runtime.language.errors import BlockError


def archive(folder: Path, name: str, content: bytes = b"x") -> Path:
    with zipfile.ZipFile(folder / "a.fmu", "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(name, content)
    return folder / "a.fmu"


@pytest.mark.parametrize("name", ["../evil", "/etc/evil", "binaries/../../evil"])
def test_names_that_climb_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(BlockError, match="leads out of its folder"):
        instance._expect_fitting(archive(tmp_path, name), tmp_path / "fresh")


def test_what_unpacks_to_too_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(instance, "MOST_UNPACKED", 1000)
    path = archive(tmp_path, "a", bytes(5000))
    with pytest.raises(BlockError, match="would unpack to 5000 bytes; expected 1000 at most"):
        instance._expect_fitting(path, tmp_path / "fresh")
    instance._expect_fitting(archive(tmp_path, "a", bytes(500)), tmp_path / "fresh")
