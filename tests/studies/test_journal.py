"""Finished runs survive what happens to the process, and damage costs only what it hit."""

from pathlib import Path

import pytest

from aloft.runtime.language.errors import AloftError
from aloft.studies.journal import Journal, Outcome

FIRST = Outcome(True, "all well", "ab", {"apex_m": 0.1, "n": 3, "none": None}, "", 1.5)


def test_what_is_kept_is_read_back_exactly(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "runs.jsonl"
    with Journal(path) as journal:
        journal.add("a", FIRST)
        journal.add("b", Outcome(False, "fell", error="broke"))
    with Journal(path) as journal:
        assert journal.outcomes == {"a": FIRST, "b": Outcome(False, "fell", error="broke")}


def test_it_is_on_disk_at_once(tmp_path: Path) -> None:
    path = tmp_path / "runs.jsonl"
    with Journal(path) as journal:
        journal.add("a", FIRST)
        assert path.read_bytes().endswith(b"}\n")


@pytest.mark.parametrize("cut", [1, 20, 60])
def test_a_line_that_was_cut_off_is_made_again_and_the_next_is_whole(
    tmp_path: Path, cut: int
) -> None:
    path = tmp_path / "runs.jsonl"
    with Journal(path) as journal:
        journal.add("a", FIRST)
        journal.add("b", FIRST)
    path.write_bytes(path.read_bytes()[:-cut])
    with Journal(path) as journal:
        assert set(journal.outcomes) == {"a"}
        journal.add("c", FIRST)
    with Journal(path) as journal:
        assert set(journal.outcomes) == {"a", "c"}
    assert path.read_bytes().count(b"\n") == 2


def test_an_interruption_between_the_file_and_the_memory_of_it_loses_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(_: int) -> None:
        raise KeyboardInterrupt

    with Journal(tmp_path / "runs.jsonl") as journal:
        journal.add("a", FIRST)
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr("os.fsync", interrupt)
            journal.add("b", FIRST)
        assert set(journal.outcomes) == {"a"}
        journal.read_back()
        assert set(journal.outcomes) == {"a", "b"}
        journal.add("c", FIRST)
    assert (tmp_path / "runs.jsonl").read_bytes().count(b"\n") == 3


def test_a_damaged_line_costs_only_itself(tmp_path: Path) -> None:
    path = tmp_path / "runs.jsonl"
    with Journal(path) as journal:
        journal.add("a", FIRST)
    path.write_bytes(b'nonsense\n[1]\n{"key": "x", "what": 1}\n' + path.read_bytes())
    with Journal(path) as journal:
        assert set(journal.outcomes) == {"a"}


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(AloftError, match=r"cannot write .*file.runs.jsonl"),
        Journal(tmp_path / "file" / "runs.jsonl"),
    ):
        pass
