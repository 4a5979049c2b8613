"""fatrop begins with given multipliers where it can, and otherwise as it always did."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from aloft.planner.solving import given_multipliers

FATROP = given_multipliers._fatrop()
pytestmark = pytest.mark.skipif(
    FATROP is None
    or given_multipliers.find_cpp_compiler() is None
    or not sys.platform.startswith("linux"),
    reason="no compiler, or CasADi has no fatrop of its own",
)

PROGRAM = """\
import json, sys
sys.path[:] = json.loads(sys.argv[1])
import numpy as np
from aloft.planner.solving import given_multipliers as given
can = sys.argv[2] == "with" and given.use_given_multipliers()
import casadi as ca
x, u, y = ca.MX.sym("x"), ca.MX.sym("u"), ca.MX.sym("y")
nlp = {"x": ca.vertcat(x, u, y), "f": (x - 1) ** 4 + ca.exp(u) + (y - 0.5) ** 2,
       "g": ca.vertcat(y - x - 0.1 * u, x * x + u)}
solver = ca.nlpsol("small", "fatrop", nlp, {
    "structure_detection": "manual", "nx": [1, 1], "nu": [1, 0], "ng": [1, 0], "N": 1,
    "print_time": False, "fatrop": {"print_level": 0}})
bounds = {"lbg": [0.0, -1.0], "ubg": [0.0, 0.5], "lbx": [-9.0, -1.0, -9.0], "ubx": [9.0, 1.0, 9.0]}
given.give(np.ones(1))
found = solver(**bounds)
bits = [np.array(found[name]).tobytes().hex() for name in ("x", "lam_g")]
taken = given.take()
print(json.dumps([can, bits, solver.stats()["iter_count"], taken is not None]))
"""


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Compiled and tried anew, in an empty cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert FATROP is not None
    found = given_multipliers._compiled(FATROP)
    assert found is not None
    return found


def test_without_multipliers_of_its_size_a_solve_has_the_same_bits(library: Path) -> None:
    """In processes of their own: what is loaded here was loaded by other tests."""
    folders = json.dumps([str(Path(folder).absolute()) for folder in sys.path])
    answers = []
    for how in ("with", "without"):
        command = [sys.executable, "-c", PROGRAM, folders, how]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        answers.append(json.loads(done.stdout.splitlines()[-1]))
    (used, bits, iterations, taken), (unused, other_bits, other_iterations, untold) = answers
    assert used and taken and not unused and not untold
    assert (bits, iterations) == (other_bits, other_iterations)


def test_one_that_gives_nothing_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(given_multipliers, "_compile", _compile_nothing)
    assert FATROP is not None
    assert given_multipliers._compiled(FATROP) is None
    (kept,) = (tmp_path / "aloft").rglob("multipliers.so")
    assert not kept.stat().st_size
    assert given_multipliers._compiled(FATROP) is None  # nor compiled and tried again


def _compile_nothing(compiler: str, fatrop: Path, library: Path) -> None:
    """A library without any of the functions."""
    source = library.with_suffix(".cpp")
    source.write_text("")
    command = [compiler, "-shared", "-fPIC", str(source), "-o", str(library)]
    subprocess.run(command, check=True, capture_output=True)


def test_without_a_compiler_solves_begin_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(given_multipliers, "find_cpp_compiler", lambda: None)
    assert FATROP is not None
    assert given_multipliers._compiled(FATROP) is None
