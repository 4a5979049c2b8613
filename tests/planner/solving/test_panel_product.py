"""The product that stands in for BLASFEO's gives its bits, is kept only then, and is the one that fatrop calls."""

from __future__ import annotations

import ctypes
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aloft.planner.solving import compilation, panel_product

BLASFEO = panel_product._blasfeo()
pytestmark = pytest.mark.skipif(
    BLASFEO is None or compilation.find_compiler() is None or not sys.platform.startswith("linux"),
    reason="no compiler, or CasADi has no BLASFEO of its own",
)

PROGRAM = """\
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from aloft.planner.solving import panel_product as product
used = product.use_panel_product()
again = product.is_loaded(product._blasfeo())
import casadi as ca
x, y = ca.SX.sym("x"), ca.SX.sym("y")
nlp = {"x": ca.vertcat(x, y), "f": (x - 1) ** 2 + y**2, "g": ca.vertcat()}
ca.nlpsol("small", "fatrop", nlp, {"fatrop": {"print_level": 0}, "print_time": False})
maps = open("/proc/self/maps").read()
print(json.dumps([used, again, "panel_product.so" in maps, "libfatrop" in maps]))
"""


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Compiled anew, in an empty cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert BLASFEO is not None
    found = panel_product._compiled(BLASFEO)
    assert found is not None
    return found


def test_it_is_the_product(library: Path) -> None:
    function = ctypes.CDLL(str(library)).kernel_dgemm_nt_4x4_lib4
    generator = np.random.default_rng(3)
    panels, given = generator.normal(size=(2, 4 * 9)), generator.normal(size=16)
    found = panel_product.panel_product(function, 9, panels, np.array([-0.5, 2.0]), given)
    a, b = (panel.reshape(9, 4).T for panel in panels)
    wanted = -0.5 * a @ b.T + 2.0 * given.reshape(4, 4).T
    np.testing.assert_allclose(found.reshape(4, 4).T, wanted, atol=1e-13)


def test_one_that_rounds_otherwise_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    other = tmp_path / "backwards.c"
    text = panel_product.SOURCE.read_text()
    summed = "share * given[0] + scale * sum0"
    assert summed in text
    other.write_text(text.replace(summed, "scale * (sum0 + share / scale * given[0])"))
    monkeypatch.setattr(panel_product, "SOURCE", other)
    assert BLASFEO is not None
    assert panel_product._compiled(BLASFEO) is None
    assert panel_product._compiled(BLASFEO) is None  # nor compiled and compared again
    assert not (tmp_path / "aloft").rglob("*.so").__next__().stat().st_size


def test_fatrop_gets_it(library: Path) -> None:
    """In a process of its own: what is loaded here was loaded by other tests."""
    folders = json.dumps([str(Path(folder).absolute()) for folder in sys.path])
    command = [sys.executable, "-c", PROGRAM, folders]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout.splitlines()[-1]) == [True, True, True, True]


def test_without_a_compiler_blasfeos_own_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(panel_product, "find_compiler", lambda: None)
    assert BLASFEO is not None
    assert panel_product._compiled(BLASFEO) is None
