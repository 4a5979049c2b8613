"""Whether the compiled libraries that a run needs can be loaded by this Python on this machine."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from importlib import import_module

from .machine_check import Finding

LIBRARIES = {
    "numpy": "numpy",
    "pydantic": "pydantic",
    "numba": "numba",
    "pin": "pinocchio",
    "mujoco-core": "mujoco",
    "casadi": "casadi",
    "daqp": "daqp",
    "pyarrow": "pyarrow",
    "rerun-sdk": "rerun",
    "eclipse-zenoh": "zenoh",
}
"""The packages of a run that hold machine code, and the names they are imported by."""

SYSTEM_PACKAGES = {"libgomp.so.1": "libgomp1", "libstdc++.so.6": "libstdc++6"}
"""Debian's packages of the shared libraries that the wheels expect of the system."""


def examine_libraries(load: Callable[[str], object] = import_module) -> Finding:
    """Load every library of ``LIBRARIES``, and say which of them fail and why.

    Args:
        load: imports a module by name, and raises ImportError or OSError where it cannot.
    """
    faults, changes = [], []
    for package, module in LIBRARIES.items():
        try:
            load(module)
        except (ImportError, OSError) as error:
            faults.append(f"{module} cannot be loaded: {error}")
            changes.append(_change(package, str(error)))
    version = ".".join(map(str, sys.version_info[:3]))
    if not faults:
        return Finding("libraries", True, f"all {len(LIBRARIES)} load with Python {version}")
    found = f"with Python {version} " + "; ".join(faults)
    return Finding("libraries", False, found, ", ".join(dict.fromkeys(changes)))


def _change(package: str, error: str) -> str:
    missing = re.match(r"(lib[\w.+-]+\.so[.\d]*): cannot open shared object", error)
    if missing and missing[1] in SYSTEM_PACKAGES:
        return f"`apt install {SYSTEM_PACKAGES[missing[1]]}`"
    return f"`pip install --force-reinstall {package}`"
