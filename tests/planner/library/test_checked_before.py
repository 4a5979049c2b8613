"""That a plan has passed its check is remembered between processes, and nothing else is."""

from __future__ import annotations

from pathlib import Path

import pytest

from aloft.mathematics.kept_arrays import code_digest
from aloft.planner.library import checked_before
from aloft.planner.library.checked_before import noted_folder, unless_passed


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


class Check:
    """A check that counts its calls, and fails where it is told to."""

    def __init__(self, fails: bool = False) -> None:
        self.calls, self.fails = 0, fails

    def __call__(self) -> None:
        self.calls += 1
        if self.fails:
            raise ValueError("not valid")


def test_what_has_passed_is_not_checked_again_and_other_content_is() -> None:
    check = Check()
    for content in (b"one", b"one", b"other", b"one"):
        unless_passed(content, check)
    assert check.calls == 2
    assert len(list(noted_folder().iterdir())) == 2


def test_what_has_failed_is_checked_every_time() -> None:
    check = Check(fails=True)
    for _ in range(2):
        with pytest.raises(ValueError, match="not valid"):
            unless_passed(b"one", check)
    assert check.calls == 2


def test_another_check_does_not_believe_what_this_one_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    check = Check()
    unless_passed(b"one", check)
    monkeypatch.setattr(checked_before, "_code", lambda: b"a changed test")
    unless_passed(b"one", check)
    assert check.calls == 2


def test_the_code_of_the_check_is_part_of_it() -> None:
    root = Path(checked_before.__file__).parents[2]
    for folder in checked_before.FOLDERS:
        assert list((root / folder).rglob("*.py")), folder
    assert checked_before._code() == code_digest(*checked_before.FOLDERS)


def test_without_a_place_for_notes_it_is_checked_every_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    check = Check()
    unless_passed(b"one", check)
    unless_passed(b"one", check)
    assert check.calls == 2
