"""Builds the page on which BRUCE is pushed in a browser: ``python extensions/export/demo/build.py FOLDER``.

The folder may be served by any web server. Needs npm, which gets MuJoCo and three.js as ``package.json`` says, and
``wasm-ld``.
"""

from __future__ import annotations

import gzip
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from world import write_world

HERE = Path(__file__).parent
JUMPS = {
    "push": "the paper's small jump", "in_place": "12 cm in place", "ahead": "12 cm up, 20 cm ahead",
}  # fmt: skip
"""The jumps of the page: graphs beside this file, and what they are called."""
SEEDS = range(1000, 1008)
"""Seeds of the robots; none was used for tuning."""
PAGE = ("index.html", "page.css", "page.js", "world.js")
LIBRARIES = (
    "@mujoco/mujoco/mujoco.js", "three/build/three.module.js", "three/build/three.core.js",
    "three/examples/jsm/controls/OrbitControls.js",
)  # fmt: skip


def build(folder: Path, jumps: Sequence[str] = tuple(JUMPS), seeds: Sequence[int] = SEEDS) -> int:
    """Write the page into a folder; gives how many bytes it has.

    Raises:
        subprocess.CalledProcessError: npm fails.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as made:
        work = Path(made)
        shutil.copy(HERE / "package.json", work)
        subprocess.run(
            ["npm", "install", "--silent", "--no-audit", "--no-fund"], cwd=work, check=True
        )
        modules = work / "node_modules"
        for name in LIBRARIES:
            shutil.copy(modules / name, folder)
        _compress(modules / "@mujoco/mujoco/mujoco.wasm", folder)
        for name in jumps:
            write_world(HERE / f"{name}.yaml", [], seeds, work, name)
            for file in (f"{name}.wasm", f"{name}.json"):
                _compress(work / file, folder)
    for name in PAGE:
        shutil.copy(HERE / name, folder)
    (folder / "jumps.json").write_text(json.dumps({name: JUMPS[name] for name in jumps}))
    return sum(file.stat().st_size for file in folder.iterdir())


def _compress(file: Path, folder: Path) -> None:
    (folder / f"{file.name}.z").write_bytes(gzip.compress(file.read_bytes(), mtime=0))


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "site/demo")
    print(f"{build(target) / 1e6:.1f} MB: serve {target} with any web server")
