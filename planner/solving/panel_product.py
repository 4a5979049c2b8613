"""Puts a faster matrix product in the place of BLASFEO's, on which fatrop spends a third of its time.

CasADi's packages carry a BLASFEO for any processor. Its product of panels of four rows, which is called from
everywhere in it, handles one number at a time. ``panel_product.c`` does the same with vectors and gives the same bits, so
plans stay the same to the byte wherever it is used or not.

The linker does the exchange. A function of a shared library is looked for in what is loaded globally
first, so this product is loaded globally, then BLASFEO, and only then CasADi's solver, which finds BLASFEO loaded.
It is compiled once and kept beside the stage functions, but only if it gives the same bits as BLASFEO's. Without a
compiler, on systems with another linker, or where BLASFEO was loaded before, BLASFEO's own product stays in use.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np

from ...mathematics.arrays import Array
from .compilation import FLAGS, cache_folder, find_compiler, made_aside, run_compiler

SOURCE = Path(__file__).with_suffix(".c")
FUNCTION = "kernel_dgemm_nt_4x4_lib4"
OPTIMISED = "-O2"
"""With less, GCC leaves the upper halves of vectors in use, and what comes behind is slower than ever."""
CASES = 200
"""Random products that have to agree to the last bit."""
_COMPARISON = """\
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from aloft.planner.solving.panel_product import same_bits
sys.exit(not same_bits(*sys.argv[2:]))
"""


@lru_cache(maxsize=1)
def use_panel_product() -> bool:
    """Put the product in BLASFEO's place in this process; whether it is there. To be called before the
    first solver is made."""
    if not sys.platform.startswith("linux"):
        return False
    blasfeo = _blasfeo()
    if blasfeo is None or is_loaded(blasfeo):
        return False
    try:
        library = _compiled(blasfeo)
        if library is None:
            return False
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
        ctypes.CDLL(str(blasfeo))
    except OSError:
        return False
    return True


def _blasfeo() -> Path | None:
    """The library that CasADi's solvers load."""
    import casadi as ca

    folder = Path(ca.__file__).parent
    return next(iter(sorted(folder.glob("libblasfeo.so.?"))), None)


def is_loaded(library: Path) -> bool:
    """Whether this process has loaded a library, which then has found its functions already."""
    try:
        ctypes.CDLL(str(library), os.RTLD_NOLOAD)
    except OSError:
        return False
    return True


def _compiled(blasfeo: Path) -> Path | None:
    """The product's library, compiled and compared if it is not kept; ``None`` if it cannot be
    used. An empty file is kept where its bits differ."""
    import casadi as ca

    content = SOURCE.read_bytes() + repr((ca.CasadiMeta.version(), FLAGS, OPTIMISED)).encode()
    folder = cache_folder() / hashlib.sha256(content).hexdigest()[:20]
    library = folder / "panel_product.so"
    if not library.is_file():
        compiler = find_compiler()
        if compiler is None:
            return None
        try:
            with made_aside(library) as made:
                run_compiler(compiler, SOURCE, made, OPTIMISED)
                if not _agrees(blasfeo, made):
                    made.write_bytes(b"")
        except subprocess.CalledProcessError:
            return None
    return library if library.stat().st_size else None


def _agrees(blasfeo: Path, library: Path) -> bool:
    """``same_bits``, in a process of its own: here BLASFEO would be loaded with its own product."""
    folders = json.dumps([str(Path(folder).absolute()) for folder in sys.path])
    command = [sys.executable, "-c", _COMPARISON, folders, str(blasfeo), str(library)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def same_bits(blasfeo: str, library: str) -> bool:
    """Whether the products of two libraries agree to the last bit for random panels."""
    generator = np.random.default_rng(0)
    functions = [getattr(ctypes.CDLL(name), FUNCTION) for name in (blasfeo, library)]
    for _ in range(CASES):
        count = int(generator.integers(0, 70))
        panels = generator.normal(size=(2, 4 * count + 4)) * 10.0 ** generator.integers(-9, 9)
        scales = generator.choice([-1.0, 0.0, 1.0, generator.normal()], size=2)
        given = generator.normal(size=16)
        first, second = (panel_product(f, count, panels, scales, given) for f in functions)
        if first.tobytes() != second.tobytes():
            return False
    return True


def panel_product(
    function: ctypes._NamedFuncPointer, count: int, panels: Array, scales: Array, given: Array
) -> Array:
    """``scales[0]`` times the product of two panels of ``count`` columns plus ``scales[1]`` times
    ``given``, of 16 numbers, by such a function."""
    arrays = [scales[:1], panels[0], panels[1], scales[1:], given, found := np.empty(16)]
    function(count, *(ctypes.c_void_p(array.ctypes.data) for array in arrays))
    return found
