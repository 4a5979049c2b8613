"""Lets fatrop begin with the multipliers of a like problem, for which CasADi's interface has no way.

An interior-point method that begins with the variables of a like problem, but without its multipliers,
spends most of its iterations on finding them. ``multipliers.cpp`` takes the place of the one function
of fatrop that sets them at the beginning, in the way that ``panel_product`` does with BLASFEO's. Where
no multipliers are given it only calls fatrop's own function, so plans from nothing are the same to the byte
with and without it. It is compiled once, tried on a small problem in a process of its own, and kept beside the
stage functions. Without a C++ compiler, on systems with another linker, or where fatrop was loaded before, solves begin
without multipliers.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import shutil
import subprocess
import sys
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from .compilation import FLAGS, cache_folder, made_aside
from .panel_product import is_loaded, use_panel_product

SOURCE = Path(__file__).with_name("multipliers.cpp")
STANDARD = "-std=c++17"
_TRIAL = """\
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from aloft.planner.solving.given_multipliers import works
sys.exit(not works(sys.argv[2]))
"""
_library: ctypes.CDLL | None = None


@lru_cache(maxsize=1)
def use_given_multipliers() -> bool:
    """Let solvers of this process begin with given multipliers; whether they can. To be called before
    the first solver is made."""
    use_panel_product()  # BLASFEO, which fatrop brings with it, must not be loaded first
    if not sys.platform.startswith("linux"):
        return False
    fatrop = _fatrop()
    if fatrop is None or is_loaded(fatrop):
        return False
    try:
        library = _compiled(fatrop)
        return library is not None and _load(library)
    except OSError:
        return False


def give(multipliers: Array | None) -> None:
    """What the next solve begins with, if it has as many; ``None``: what fatrop begins with."""
    if _library is not None:
        values = np.empty(0) if multipliers is None else np.ascontiguousarray(multipliers, float)
        _library.aloft_give_multipliers(ctypes.c_void_p(values.ctypes.data), len(values))


def take() -> Array | None:
    """The multipliers with which the last solve ended; ``None`` where they cannot be told."""
    if _library is None:
        return None
    values = np.empty(_library.aloft_take_multipliers(None, 0))
    _library.aloft_take_multipliers(ctypes.c_void_p(values.ctypes.data), len(values))
    return values if len(values) and np.isfinite(values).all() else None


def _load(library: Path) -> bool:
    global _library
    _library = ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    return True


def _fatrop() -> Path | None:
    """The library that CasADi's solver loads."""
    import casadi as ca

    folder = Path(ca.__file__).parent
    return next(iter(sorted(folder.glob("libfatrop.so.*"))), None)


@lru_cache(maxsize=1)
def find_cpp_compiler() -> str | None:
    """The C++ compiler; ``None`` where there is none."""
    return next((path for name in ("c++", "g++", "clang++") if (path := shutil.which(name))), None)


def _compiled(fatrop: Path) -> Path | None:
    """The library, compiled and tried if it is not kept; ``None`` if it cannot be used. An empty file is kept where it does not work."""
    import casadi as ca

    content = SOURCE.read_bytes() + repr((ca.CasadiMeta.version(), FLAGS, STANDARD)).encode()
    folder = cache_folder() / hashlib.sha256(content + os.fsencode(fatrop)).hexdigest()[:20]
    library = folder / "multipliers.so"
    if not library.is_file():
        compiler = find_cpp_compiler()
        if compiler is None:
            return None
        try:
            with made_aside(library) as made:
                _compile(compiler, fatrop, made)
                if not _tried(made):
                    made.write_bytes(b"")
        except subprocess.CalledProcessError:
            return None
    return library if library.stat().st_size else None


def _compile(compiler: str, fatrop: Path, library: Path) -> None:
    folder = fatrop.parent
    linked = [f"-L{folder}", f"-l:{fatrop.name}", "-l:libblasfeo.so.0", f"-Wl,-rpath,{folder}"]
    command = [compiler, STANDARD, *FLAGS, f"-I{folder / 'include'}", str(SOURCE)]
    command += ["-o", str(library), *linked, "-ldl"]
    subprocess.run(command, check=True, capture_output=True)


def _tried(library: Path) -> bool:
    """``works``, in a process of its own: a library that does not work may take its process down."""
    folders = json.dumps([str(Path(folder).absolute()) for folder in sys.path])
    command = [sys.executable, "-c", _TRIAL, folders, str(library)]
    try:
        done = subprocess.run(command, capture_output=True, check=False, timeout=60.0)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def works(library: str) -> bool:
    """Whether, on a small problem, multipliers can be taken and a solve that is given them ends sooner at the same optimum."""
    import casadi as ca

    _load(Path(library))
    x, u, y = ca.MX.sym("x"), ca.MX.sym("u"), ca.MX.sym("y")
    cost, rows = (x - 1) ** 2 + u**2 + (y - 0.5) ** 2, ca.vertcat(y - x - 0.1 * u, x * x)
    nlp: dict[str, Any] = {"x": ca.vertcat(x, u, y), "f": cost, "g": rows}
    options: dict[str, Any] = {
        "structure_detection": "manual", "nx": [1, 1], "nu": [1, 0], "ng": [1, 0], "N": 1,
        "print_time": False, "fatrop": {"print_level": 0, "mu_init": 1e-7, "tol": 1e-6},
    }  # fmt: skip
    solver = ca.nlpsol("trial", "fatrop", nlp, options)
    given = {"lbg": [0.0, -1.0], "ubg": [0.0, 0.5]}
    first = solver(**given)
    cold, found = solver.stats()["iter_count"], take()
    if found is None:
        return False
    give(found)
    second = solver(**given, x0=first["x"])
    near = np.allclose(np.array(first["x"]), np.array(second["x"]), atol=1e-4)
    fewer = bool(solver.stats()["success"]) and solver.stats()["iter_count"] < cold
    return bool(near and fewer)
