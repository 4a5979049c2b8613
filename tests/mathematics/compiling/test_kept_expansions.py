"""The rewritten code of kernels is kept, and made anew where anything that it was made of is another."""

from __future__ import annotations

import importlib.util
import sys
from itertools import count

import numpy as np
import pytest

from aloft.mathematics.compiling import equations
from aloft.mathematics.compiling.equations import expanded_code
from aloft.mathematics.compiling.expressions import NUMBERS
from aloft.mathematics.compiling.kept_expansions import EXPANSIONS, kept_expansion
from aloft.mathematics.compiling.kernel_registry import written_code
from aloft.mathematics.rotations import skew

SOURCE = """
from aloft.mathematics.arrays import Array1D
from aloft.mathematics.kernel import kernel

SCALE = 2

@kernel
def scaled(x: Array1D, out: Array1D) -> None:
    out[:] = SCALE * x
"""
numbers = count()


@pytest.fixture(autouse=True)
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def kept():
    """The files of the cache."""
    return sorted(EXPANSIONS.folder.rglob("*")) if EXPANSIONS.folder.is_dir() else []


def load(tmp_path, text):
    """Import a text as a module of its own, always of the same file."""
    file = tmp_path / "kernels_kept.py"
    file.write_text(text)
    name = f"kernels_kept_{next(numbers)}"
    spec = importlib.util.spec_from_file_location(name, file)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def test_what_is_kept_is_what_is_made(monkeypatch):
    code = written_code(skew)
    made = kept_expansion(skew, code)
    assert len(kept()) == 1
    monkeypatch.setattr(equations, "expanded_code", lambda *_: pytest.fail("made twice"))
    again = kept_expansion(skew, code)
    assert again == made == expanded_code(skew, code)
    assert (again.co_linetable, again.co_filename) == (made.co_linetable, code.co_filename)


def test_another_statement_constant_or_line_is_made_anew(tmp_path):
    texts = SOURCE, SOURCE.replace("* x", "+ x"), SOURCE.replace("= 2", "= 3"), "\n" + SOURCE
    for text, result in zip(texts, (10.0, 7.0, 15.0, 10.0), strict=True):
        out = np.zeros(1)
        load(tmp_path, text).scaled(np.array([5.0]), out)
        assert out[0] == result
    assert len(kept()) == len(texts)


def test_what_is_damaged_is_made_anew(tmp_path):
    code = written_code(skew)
    made = kept_expansion(skew, code)
    (file,) = kept()
    file.write_bytes(file.read_bytes()[:-40] + bytes(40))
    assert kept_expansion(skew, code) == made
    assert len(kept()) == 1


def test_without_a_home_it_is_made(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "nowhere" / "file"))
    (tmp_path / "nowhere").write_text("a file, in which there is no folder")
    assert kept_expansion(skew, written_code(skew)) == expanded_code(skew, written_code(skew))


def test_what_is_kept_runs_in_a_module_that_nothing_was_rewritten_in(tmp_path, monkeypatch):
    text = "import numpy as np\n" + SOURCE.replace("SCALE * x", "np.sign(x)")
    for _ in range(2):  # the second is from the cache
        module, out = load(tmp_path, text), np.zeros(2)
        module.scaled(np.array([-3.0, 2.0]), out)
        assert out.tolist() == [-1.0, 1.0]
        assert NUMBERS in vars(module), "a function of it stands for NumPy's"
        monkeypatch.setattr(equations, "expanded_code", lambda *_: pytest.fail("made twice"))
