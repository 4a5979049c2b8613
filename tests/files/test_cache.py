"""What is kept: used only as it was written, under its own name, from folders that are this user's only."""

import os
import re
import shutil
import stat
from pathlib import Path

import numpy as np
import pytest

from aloft.files import cache as module
from aloft.files.cache import Cache, cache_root, make_folders, trusted_file, unsealed
from aloft.logs.file.code import TRUSTED
from aloft.mathematics.compiling.kept_expansions import EXPANSIONS
from aloft.mathematics.compiling.machine_code import _HOSTS
from aloft.mathematics.compiling.store import CACHE as KERNELS
from aloft.mathematics.kept_arrays import CACHE as ARRAYS
from aloft.planner.library.validation_cache import NOTES
from aloft.planner.solving.kept_functions import FUNCTIONS

KINDS = (KERNELS, EXPANSIONS, _HOSTS, ARRAYS, NOTES, FUNCTIONS, TRUSTED)
each_kind = pytest.mark.parametrize("cache", KINDS, ids=lambda cache: cache.kind)
DATA = bytes(range(256)) * 3
NO_CODE = {"build", "venv"}
"""Folders beside the package's in a checkout, which may hold other people's."""


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


def kept(cache: Cache, name: str = "ab/cd", data: bytes = DATA) -> Path:
    assert cache.save(name, data)
    path = cache.path(name)
    assert path is not None and cache.load(name) == data
    return path


def test_all_that_is_kept_is_tried() -> None:
    package = Path(module.__file__).parents[1]
    found = {
        kind
        for folder in sorted(package.glob("[a-z]*"))
        if folder.name not in NO_CODE
        for path in folder.rglob("*.py")
        if "tests" not in path.relative_to(package).parts
        for kind in re.findall(r"= Cache\(\"(\w+)\"", path.read_text(encoding="utf-8"))
    }
    assert found == {cache.kind for cache in KINDS}


@each_kind
def test_no_flipped_bit_and_no_cut_is_used(cache: Cache) -> None:
    path = kept(cache)
    whole = path.read_bytes()
    for place in [*range(0, len(whole), 97), len(whole) - 1]:
        for bit in (0, 7):
            damaged = bytearray(whole)
            damaged[place] ^= 1 << bit
            path.write_bytes(damaged)
            assert cache.load("ab/cd") is None
    for length in (0, 1, module.DIGEST - 1, module.DIGEST, len(whole) - 1):
        path.write_bytes(whole[:length])
        assert cache.load("ab/cd") is None
    path.write_bytes(whole + b"\0")
    assert cache.load("ab/cd") is None
    kept(cache)  # made anew


@each_kind
def test_exchanged_files_are_not_used(cache: Cache) -> None:
    first, second = kept(cache, "ab/1", b"one"), kept(cache, "ab/2", b"two")
    one, two = first.read_bytes(), second.read_bytes()
    first.write_bytes(two)
    second.write_bytes(one)
    assert cache.load("ab/1") is None and cache.load("ab/2") is None
    for other in KINDS:
        if other is not cache:
            kept(other, "ab/1", b"one").write_bytes(one)
            assert other.load("ab/1") is None, "nor one of another kind"


def test_the_digest_of_nothing_is_not_nothing() -> None:
    assert unsealed("a", b"") is None
    path = kept(NOTES, "note", b"")
    path.write_bytes(b"")
    assert NOTES.load("note") is None


@pytest.mark.parametrize("umask", [0o000, 0o002, 0o077])
def test_files_and_folders_are_this_users_only(umask: int, home: Path) -> None:
    before = os.umask(umask)
    try:
        path = kept(KERNELS)
        for each in (path, *path.parents):
            if home in each.parents:
                assert not each.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH), each
    finally:
        os.umask(before)


@pytest.mark.parametrize("place", ["file", "folder", "kind", "root"])
def test_nothing_is_used_where_others_may_write(place: str) -> None:
    path = kept(KERNELS)
    root = cache_root()
    assert root is not None
    changed = {"file": path, "folder": path.parent, "kind": path.parent.parent, "root": root}[place]
    for mode in (0o020, 0o002):
        before = stat.S_IMODE(changed.stat().st_mode)
        changed.chmod(before | mode)
        assert KERNELS.load("ab/cd") is None and not trusted_file(path)
        changed.chmod(before)
        assert KERNELS.load("ab/cd") == DATA and trusted_file(path)


def test_folders_that_were_open_are_closed_and_files_that_were_are_replaced() -> None:
    path = kept(KERNELS)
    path.parent.chmod(0o777)
    path.chmod(0o666)
    kept(KERNELS)
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o755
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


@each_kind
@pytest.mark.parametrize("what", ["root", "file"])
def test_what_another_user_laid_there_is_not_used(
    cache: Cache, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = kept(cache)
    other = os.geteuid() + 1
    if os.geteuid() == 0:
        os.chown(path if what == "file" else path.parents[2], other, -1)
    else:  # no right to give it away: be another one
        monkeypatch.setattr(module, "_user", lambda: other)
    assert cache.load("ab/cd") is None and not trusted_file(path)
    if what == "root":
        assert not cache.save("ab/cd", DATA), "nor is anything laid into another user's folder"


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    path = kept(KERNELS)
    elsewhere = tmp_path / "elsewhere"
    path.rename(elsewhere)
    path.symlink_to(elsewhere)
    assert KERNELS.load("ab/cd") is None


def test_a_write_that_fails_leaves_what_was_there(monkeypatch: pytest.MonkeyPatch) -> None:
    path = kept(KERNELS)

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert not KERNELS.save("ab/cd", b"new")
    assert KERNELS.load("ab/cd") == DATA
    assert list(path.parent.iterdir()) == [path], "and nothing else"


@each_kind
@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_writer_that_is_killed_leaves_what_was_there(
    call: str, cache: Cache, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept(cache)
    then, real = home.with_name("then"), getattr(os, call)

    def killed(*arguments: object) -> None:
        shutil.copytree(home, then)  # what is on the disk at this instant
        real(*arguments)

    monkeypatch.setattr(os, call, killed)
    assert cache.save("ab/cd", b"new")
    monkeypatch.setattr(os, call, real)
    monkeypatch.setenv("XDG_CACHE_HOME", str(then))
    assert len([path for path in then.rglob("*") if path.is_file()]) == 2
    assert cache.load("ab/cd") == DATA
    kept(cache, data=b"new")


def test_it_is_on_the_disk_before_it_has_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    sync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda fd: (done.append("fsync"), sync(fd)))
    monkeypatch.setattr(os, "replace", lambda a, b: (done.append("replace"), replace(a, b)))
    kept(KERNELS)
    assert done == ["fsync", "replace"]


def test_without_a_home_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME")

    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", homeless)
    assert cache_root() is None and KERNELS.path("a") is None
    assert not KERNELS.save("a", b"") and KERNELS.load("a") is None and not KERNELS.holds("a")
    assert not make_folders(Path("a"))


def test_a_relative_cache_folder_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "here")
    assert cache_root() == Path.home() / ".cache" / "aloft"


def test_those_used_last_stay() -> None:
    cache = Cache("few", most=2)
    for number in range(3):
        path = kept(cache, str(number))
        os.utime(path, (number, number))
        if number == 1:
            assert cache.load("0") is not None  # used again: its time is the newest
    assert [cache.load(str(n)) is not None for n in range(3)] == [True, False, True]


def test_arrays_of_another_form_are_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    from aloft.mathematics.kept_arrays import kept_arrays

    kept_arrays(b"key", lambda: {"a": np.arange(3.0)})
    folder = ARRAYS.folder
    assert folder is not None
    (file,) = folder.iterdir()
    ARRAYS.save(file.stem, b"no archive")
    assert kept_arrays(b"key", lambda: {"a": np.arange(4.0)})["a"].shape == (4,)
