"""Names inside files of others stay in their folder."""

from pathlib import Path

import pytest

from aloft.files.names import UnsafeNameError, inside, is_file_name


@pytest.mark.parametrize(
    "name",
    ["", ".", "/etc/passwd", "../a", "a/../../b", "..", "a\\b", "C:a", "a\0b", "a\nb", "~/../../a"],
)
def test_names_that_leave_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(UnsafeNameError, match="leads out of its folder"):
        inside(tmp_path, name)
    assert not is_file_name(name)


def test_names_that_stay(tmp_path: Path) -> None:
    assert inside(tmp_path, "a/b.npz") == tmp_path / "a/b.npz"
    assert is_file_name("b.npz") and not is_file_name("a/b.npz")


def test_a_link_that_leads_out(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in/link").symlink_to(tmp_path)
    with pytest.raises(UnsafeNameError, match="through a link"):
        inside(tmp_path / "in", "link/a")
