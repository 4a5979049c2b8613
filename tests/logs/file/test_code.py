"""The code that a graph runs and that is not aloft's: found without running it, known by its content."""

from pathlib import Path

import pytest

from aloft.logs.file.code import (
    UntrustedCodeError,
    code_of,
    expect_trusted,
    module_digest,
    remember,
)
from aloft.runtime.loading import flattened_text

GRAPH = """\
rate: 100 Hz
blocks:
  a: {use: "own:A"}
  b: {use: export.CoSimulation, with: {file: thing.fmu}}
  c: {use: export.CLibrary, with: {folder: made}}
  d: {use: blocks.WholeBodyController, with: {tasks: {lean: {use: "own.tasks:Lean"}}}}
  e: {use: blocks.Ramp, with: {slope: 1, unit: ""}}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "own").mkdir()
    (tmp_path / "own/__init__.py").write_text("from . import helper\nraise SystemExit")
    (tmp_path / "own/helper.py").write_text("x = 1")
    (tmp_path / "own/tasks.py").write_text("raise SystemExit")
    (tmp_path / "thing.fmu").write_bytes(b"a program")
    (tmp_path / "made").mkdir()
    (tmp_path / "made/libmade.so").write_bytes(b"a program")
    return tmp_path


def test_modules_programs_and_libraries_are_found(folder: Path) -> None:
    found = code_of(flattened_text(GRAPH, folder / "graph.yaml"))
    names = [(code.block, code.name) for code in found]
    assert names == [
        ("a", "own:A"), ("b", "thing.fmu"), ("c", "made"), ("d", "own.tasks:Lean"),
    ]  # fmt: skip
    assert found[0].place == folder / "own/__init__.py"


def test_the_digest_has_what_a_module_imports(folder: Path) -> None:
    before = module_digest(folder / "own/__init__.py", "own:A")
    assert module_digest(folder / "own/__init__.py", "own:A") == before
    (folder / "own/helper.py").write_text("x = 2")
    assert module_digest(folder / "own/__init__.py", "own:A") != before


def test_trust_is_by_content(folder: Path) -> None:
    found = code_of(flattened_text(GRAPH, folder / "graph.yaml"))
    with pytest.raises(UntrustedCodeError, match=r"own:A of a, from .*--trust") as error:
        expect_trusted(found, Path("a.rrd"))
    assert "thing.fmu of b" in str(error.value)
    remember(found)
    expect_trusted(found, Path("a.rrd"))
    (folder / "thing.fmu").write_bytes(b"another program")
    with pytest.raises(UntrustedCodeError, match=r"before: thing.fmu of b"):
        expect_trusted(code_of(flattened_text(GRAPH, folder / "graph.yaml")), Path("a.rrd"))


def test_a_file_that_another_program_laid_there_is_no_trust(folder: Path) -> None:
    found = code_of(flattened_text(GRAPH, folder / "graph.yaml"))
    remember(found[:1])
    kept = folder / "cache/aloft/trusted"
    (kept / found[1].digest).write_bytes(
        (kept / found[0].digest).read_bytes()
    )  # under another name
    (kept / found[2].digest).touch(mode=0o600)
    with pytest.raises(UntrustedCodeError, match=r"thing.fmu of b.*made of c"):
        expect_trusted(found[:3], Path("a.rrd"))
    kept.chmod(0o777)  # anybody may write there
    with pytest.raises(UntrustedCodeError, match="own:A of a"):
        expect_trusted(found[:1], Path("a.rrd"))
