"""Files that are whole or not there, and what a killed process leaves behind."""

import os
from pathlib import Path

import pytest

from aloft.planner.task.whole_file import ABANDONED, remove_abandoned, write_whole


def test_it_replaces_what_is_there(tmp_path: Path) -> None:
    path = tmp_path / "new" / "file"
    assert write_whole(path, b"one") == path
    write_whole(path, b"two")
    assert path.read_bytes() == b"two"
    assert list(path.parent.iterdir()) == [path]


def test_what_cannot_be_written_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_whole(tmp_path / "file", b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_whole(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_abandoned_parts_are_removed_and_young_ones_are_not(tmp_path: Path) -> None:
    old, young = tmp_path / ".a.npz.1.part", tmp_path / ".b.npz.2.part"
    for part in (old, young):
        part.write_bytes(b"half")
    time = young.stat().st_mtime - ABANDONED - 10.0
    os.utime(old, (time, time))
    remove_abandoned(tmp_path)
    remove_abandoned(tmp_path / "nowhere")
    assert list(tmp_path.iterdir()) == [young]
