"""Functions are compiled once, whoever asks for them, and are the same without a compiler."""

from __future__ import annotations

import fcntl
from pathlib import Path
from typing import Any

import casadi as ca
import pytest

from aloft.files.cache import make_folders
from aloft.planner.models.symbolic_model import SymbolicModel
from aloft.planner.problem.stage_functions import StageFunction, derived
from aloft.planner.solving import compilation
from aloft.planner.solving.compilation import FunctionSet, load_functions
from aloft.robots.description import find_robot

PIECES = ("slow", "quick")
needs_compiler = pytest.mark.skipif(compilation.find_compiler() is None, reason="no C compiler")


def make(name: str) -> StageFunction:
    z, w = ca.SX.sym("z", 2), ca.SX.sym("w")
    return derived(f"test_{name}", z, w, w * z[0] ** 2, ca.vertcat(z[0] * z[1]))


FUNCTIONS = FunctionSet("test", PIECES, (), make)


def load(**options: Any) -> dict[str, StageFunction]:
    model: Any = type("Model", (SymbolicModel,), {"__init__": lambda self: None})()
    model.robot, model.loads = find_robot("bruce"), ()
    return load_functions(FUNCTIONS, model, **options)


@pytest.fixture(autouse=True)
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """An empty cache; what is compiled, in its order."""
    compiled: list[str] = []
    real = compilation._compile

    def compile_piece(compiler: str, piece: StageFunction, library: str) -> bool:
        compiled.append(library.rpartition("/")[2])
        return real(compiler, piece, library)

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(compilation, "_held", {})
    monkeypatch.setattr(compilation, "_compile", compile_piece)
    return compiled


def values(pieces: dict[str, StageFunction]) -> list[list[float]]:
    return [[float(v) for v in pieces[name].value([3.0, 2.0], 0.5)] for name in PIECES]


@needs_compiler
def test_once_compiled_always_there(made: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert values(load()) == [[4.5, 6.0]] * 2
    monkeypatch.setattr(compilation, "_held", {})
    assert values(load()) == [[4.5, 6.0]] * 2
    assert made == list(PIECES)


def test_without_a_compiler(made: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compilation, "find_compiler", lambda: None)
    assert values(load()) == [[4.5, 6.0]] * 2
    assert made == []
    folder = compilation.LIBRARIES.folder
    assert folder is not None and not list(folder.rglob("*"))


@needs_compiler
def test_what_another_process_compiles_is_waited_for_last(
    made: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = find_robot("bruce")
    key = compilation.content_hash(robot, "test", (), ())
    library = compilation.LIBRARIES.path(f"{key}/slow")
    assert library is not None and make_folders(library.parent)
    # A second description of the open file: this process holds the lock as another one would.
    other = library.with_suffix(".lock").open("w")
    fcntl.flock(other, fcntl.LOCK_EX)
    counted = compilation._compile

    def and_meanwhile(compiler: str, piece: StageFunction, made_here: str) -> bool:
        done = counted(compiler, piece, made_here)
        if made_here.endswith("/quick"):  # now the other process has made the slow one
            assert counted(compiler, make("slow"), f"{key}/slow")
            other.close()
        return done

    monkeypatch.setattr(compilation, "_compile", and_meanwhile)
    assert values(load()) == [[4.5, 6.0]] * 2
    assert made == ["quick", "slow"], "the slow one once, by the other"


@needs_compiler
def test_a_cache_that_cannot_be_written_is_done_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert values(load()) == [[4.5, 6.0]] * 2


@needs_compiler
@pytest.mark.parametrize(
    ("long", "flags"), [(10**6, {"slow": "-O0", "quick": ""}), (1, {"slow": "-O0", "quick": "-O0"})]
)
def test_what_is_long_is_not_optimised_and_the_same(
    long: int, flags: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found: dict[str, str] = {}
    real = compilation.run_compiler

    def run(compiler: str, source: Path, library: Path, *more: str) -> None:
        found[library.stem] = " ".join(more)
        real(compiler, source, library, *more)

    monkeypatch.setattr(compilation, "run_compiler", run)
    monkeypatch.setattr(compilation, "OPTIMISED", ("quick",))
    monkeypatch.setattr(compilation, "LONG", long)
    assert values(load()) == [[4.5, 6.0]] * 2
    assert found == flags


@needs_compiler
@pytest.mark.parametrize("damage", ["empty", "bit", "cut", "exchanged"])
def test_a_damaged_library_is_compiled_anew(
    damage: str, made: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    load()
    folder = compilation.LIBRARIES.folder
    assert folder is not None
    quick, slow = (next(folder.rglob(f"{name}.so")) for name in ("quick", "slow"))
    content = {
        "empty": b"",
        "bit": quick.read_bytes().replace(b"\x7fELF\x02", b"\x7fELF\x03", 1),
        "cut": quick.read_bytes()[:-4096],
        "exchanged": slow.read_bytes(),
    }[damage]
    # a loaded library is not written into: it is taken away and another one laid there
    quick.unlink()
    quick.write_bytes(content)
    monkeypatch.setattr(compilation, "_held", {})
    made.clear()
    assert values(load()) == [[4.5, 6.0]] * 2
    assert made == ["quick"]
