"""Arrays are computed once for the same key, come back bit by bit, and are never needed."""

from __future__ import annotations

import os
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from aloft.mathematics import kept_arrays as module
from aloft.mathematics.kept_arrays import code_digest, kept_arrays


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


class Computation:
    """Gives arrays and counts how often."""

    def __init__(self) -> None:
        self.calls = 0
        self.arrays = {
            "file": np.array([0.1, -0.0, np.inf, 1e-310]),
            "column b": np.eye(3)[:, ::-1],
            "flags": np.array([[True, False]]),
            "none": np.zeros((0, 3)),
        }

    def __call__(self) -> dict[str, np.ndarray]:
        self.calls += 1
        return self.arrays


def same(found, expected) -> bool:
    return list(found) == list(expected) and all(
        found[name].dtype == array.dtype
        and found[name].shape == array.shape
        and found[name].tobytes() == array.tobytes()
        for name, array in expected.items()
    )


def test_the_same_bits_come_back_without_computing_them_again() -> None:
    compute = Computation()
    for _ in range(3):
        assert same(kept_arrays(b"key", compute), compute.arrays)
    assert compute.calls == 1


def test_another_key_or_processor_is_computed_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    compute = Computation()
    kept_arrays(b"key", compute)
    kept_arrays(b"other", compute)
    monkeypatch.setattr(module, "processor", lambda: b"another one")
    kept_arrays(b"key", compute)
    assert compute.calls == 3


def kept_folder() -> Path:
    assert module.CACHE.folder is not None
    return module.CACHE.folder


def test_the_processor_is_known_by_what_numpy_may_use() -> None:
    features = np._core._multiarray_umath.__cpu_features__
    named = module.processor().decode()
    assert all((f"'{name}'" in named) == present for name, present in features.items())


@pytest.mark.parametrize("damage", [b"", b"damaged", None])
def test_a_damaged_file_is_made_anew(damage: bytes | None) -> None:
    compute = Computation()
    kept_arrays(b"key", compute)
    (file,) = kept_folder().iterdir()
    content = bytearray(file.read_bytes())
    content[200] ^= 1  # within the numbers of the first array, which the file's checksum covers
    file.write_bytes(bytes(content) if damage is None else damage)
    assert same(kept_arrays(b"key", compute), compute.arrays)
    assert same(kept_arrays(b"key", compute), compute.arrays)
    assert compute.calls == 2


def test_without_a_place_they_are_computed_every_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    compute = Computation()
    for _ in range(2):
        assert same(kept_arrays(b"key", compute), compute.arrays)
    assert compute.calls == 2


def test_nothing_is_kept_of_an_error() -> None:
    def fail() -> dict[str, np.ndarray]:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        kept_arrays(b"key", fail)
    assert not kept_folder().exists()


def test_those_used_last_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "CACHE", replace(module.CACHE, most=3))
    compute = Computation()
    for number in range(3):
        kept_arrays(b"%d" % number, compute)
        for file in kept_folder().iterdir():  # a while passes
            os.utime(file, (file.stat().st_atime, file.stat().st_mtime - 10.0))
    kept_arrays(b"0", compute)
    kept_arrays(b"3", compute)
    assert compute.calls == 4
    kept_arrays(b"0", compute)
    assert compute.calls == 4
    kept_arrays(b"1", compute)
    assert compute.calls == 5


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "mathematics").mkdir()
    (tmp_path / "robots" / "parts").mkdir(parents=True)
    (tmp_path / "robots" / "parts" / "leg.py").write_text("a = 1\n")
    (tmp_path / "robots" / "robot.yaml").write_text("mass: 1\n")
    monkeypatch.setattr(module, "__file__", str(tmp_path / "mathematics" / "kept_arrays.py"))
    return tmp_path


def digest(*folders: str) -> bytes:
    """As in a new process."""
    module._folder_digest.cache_clear()
    module._versions.cache_clear()
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


def test_the_versions_of_libraries_are_part_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = digest("mathematics")
    assert f"numpy-{metadata.version('numpy')}.dist-info" in module._versions().decode()
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "numpyro-0.0.dist-info").mkdir()
    assert digest("mathematics") == before
    (tmp_path / "numpy-0.0.dist-info").mkdir()
    assert digest("mathematics") != before
    module._versions.cache_clear()
