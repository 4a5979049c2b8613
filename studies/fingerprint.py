"""The code, the data and the library versions that decide the outcome of a run, besides its graph."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parent.parent
FOLDERS = ("mathematics", "robots", "runtime", "blocks", "planner", "hal")
SUFFIXES = (".py", ".yaml")
LIBRARIES = ("numpy", "mujoco-core", "mujoco", "pin", "daqp", "qpsolvers")


@cache
def code_fingerprint() -> str:
    """A hash of all code that may run in a graph, of the shipped plans, and of the versions of
    what computes. Results that were made by other code are therefore not used."""
    digest = hashlib.sha256()
    files = [p for folder in FOLDERS for p in (ROOT / folder).rglob("*") if p.suffix in SUFFIXES]
    for path in sorted([*files, *(ROOT / "graphs" / "plans").glob("*.npz")]):
        digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    for name in LIBRARIES:
        try:
            digest.update(f"{name} {metadata.version(name)}\n".encode())
        except metadata.PackageNotFoundError:
            continue
    return digest.hexdigest()[:24]
