"""TSID as a peer: what is said where it is not there. That its torques agree is checked by the benchmark
itself, because TSID's Pinocchio cannot be in the process of the tests."""

import sys
from pathlib import Path
from types import ModuleType

import pytest

from aloft.lab.benchmarks.tick.tsid import INSTALL, import_tsid
from aloft.runtime.language.errors import AloftError


def site(folder: Path) -> Path:
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    return folder / "cmeel.prefix" / "lib" / version / "site-packages"


def test_a_folder_without_it_says_how_to_get_it(tmp_path: Path) -> None:
    with pytest.raises(AloftError, match=r"there is no TSID for python3\.\d+ in ") as error:
        import_tsid(tmp_path)
    assert INSTALL in str(error.value)


def test_another_pinocchio_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (site(tmp_path) / "tsid").mkdir(parents=True)
    other = ModuleType("pinocchio")
    other.__file__ = "/elsewhere/pinocchio/__init__.py"
    monkeypatch.setitem(sys.modules, "pinocchio", other)
    with pytest.raises(AloftError, match="another version of Pinocchio is in use"):
        import_tsid(tmp_path)
    assert str(site(tmp_path)) not in sys.path
