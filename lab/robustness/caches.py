"""Damages what is kept in the cache folder, in every way and kind, and counts the runs that are as before.

``python -m aloft.lab.robustness.caches 5 kernels`` prints the rows of a kind, each tried five times; without kinds all of
``KINDS``. Each run is a process of its own with a cache
folder that a whole run has filled; it counts if it ends with success and the same run hash, or, of the
planner's code, with the same values of its functions.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ...files.cache import cache_root

SEED = 54
JUMP = Path(__file__).parents[2] / "graphs" / "jump.yaml"
HEAD = ("what is damaged", "how", "runs as before")

Damage = Callable[[list[Path], random.Random], None]


def flip(found: list[Path], draw: random.Random) -> None:
    """Flip one bit in every tenth file."""
    for path in found[:: max(1, len(found) // 10)]:
        data = bytearray(path.read_bytes())
        if data:
            data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
        _lay(path, bytes(data))


def cut(found: list[Path], draw: random.Random) -> None:
    """Cut every file off somewhere."""
    for path in found:
        data = path.read_bytes()
        _lay(path, data[: draw.randrange(len(data) or 1)])


def empty(found: list[Path], draw: random.Random) -> None:
    """Empty every file."""
    for path in found:
        _lay(path, b"")


def exchange(found: list[Path], draw: random.Random) -> None:
    """Exchange files with each other."""
    data = [path.read_bytes() for path in found]
    for path, other in zip(found, [*data[1:], data[0]], strict=True):
        _lay(path, other)


def open_to_others(found: list[Path], draw: random.Random) -> None:
    """Let everybody write into folders and files."""
    for path in found:
        path.chmod(0o666)
        path.parent.chmod(0o777)


def of_another(found: list[Path], draw: random.Random) -> None:
    """Lay files there that belong to another user, each with another one's content."""
    exchange(found, draw)
    for path in found:
        os.chown(path, os.geteuid() + 1, -1)


DAMAGES: Sequence[Damage] = (flip, cut, empty, exchange, open_to_others, of_another)


def _lay(path: Path, data: bytes) -> None:
    path.unlink()
    path.write_bytes(data)
    path.chmod(0o600)


def outcome(cache: Path, **extra: str) -> str:
    """Return the hash of a run of ``JUMP`` with this cache folder; the exit code where it failed."""
    env = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    if "home" in extra:
        env["HOME"] = extra["home"]
    done = subprocess.run(
        [sys.executable, "-m", "aloft", "run", str(JUMP), "--no-record", "--json"],
        check=False, env=env, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    return (
        f"exit code {done.returncode}" if done.returncode else json.loads(done.stdout)["run_hash"]
    )


def _files(home: Path, kind: str) -> list[Path]:
    return [p for p in sorted((home / "aloft" / kind).rglob("*")) if p.is_file()]


KINDS = ("kernels", "arrays", "checked", "planner", "folder")


def rows(turns: int, kinds: Sequence[str]) -> Iterator[Sequence[str]]:
    """Return the rows of the table."""
    draw = random.Random(SEED)
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole"
        expected = outcome(whole) if set(kinds) != {"planner"} else ""
        for kind in (kind for kind in ("kernels", "arrays", "checked") if kind in kinds):
            for damage in DAMAGES:
                same = 0
                for turn in range(turns):
                    home = Path(folder) / f"{kind}-{damage.__name__}-{turn}"
                    shutil.copytree(whole, home)
                    damage(_files(home, kind), draw)
                    same += outcome(home) == expected
                    shutil.rmtree(home)
                yield kind, (damage.__doc__ or "").rstrip("."), f"{same} of {turns}"
        if "planner" in kinds:
            yield from _functions(Path(folder), draw, turns)
        for name, home in _homes(Path(folder)) if "folder" in kinds else ():
            found = outcome(home, home=str(home))
            yield "the cache folder", name, f"{int(found == expected)} of 1"


def _functions(folder: Path, draw: random.Random, turns: int) -> Iterator[Sequence[str]]:
    """Damage the planner's kept functions; a child evaluates them."""
    evaluate = (
        "from aloft.robots.description import find_robot;"
        "from aloft.planner.models.symbolic_model import SymbolicModel;"
        "from aloft.planner.problem.stage_functions import make_coordinates;"
        "from aloft.planner.solving.kept_functions import load_pieces;"
        "model = SymbolicModel(find_robot('bruce'));"
        "sagittal = make_coordinates(model, 'sagittal');"
        "pieces = load_pieces(model, sagittal, names=('stance', 'flight'));"
        "import casadi as ca;"
        "inputs = lambda f: [ca.DM.ones(f.sparsity_in(k)) * 0.1 for k in range(f.n_in())];"
        "print([str(p.value(*inputs(p.value))) for p in pieces.values()])"
    )

    def evaluated(home: Path) -> str:
        env = {**os.environ, "XDG_CACHE_HOME": str(home)}
        done = subprocess.run(
            [sys.executable, "-c", evaluate],
            check=False,
            env=env,
            capture_output=True,
            text=True,
            timeout=900,
        )
        return done.stdout.strip() if not done.returncode else f"exit code {done.returncode}"

    whole = folder / "planner"
    expected = evaluated(whole)
    for damage in DAMAGES:
        same = 0
        for turn in range(turns):
            home = folder / f"planner-{damage.__name__}-{turn}"
            shutil.copytree(whole, home)
            damage(_files(home, "planner"), draw)
            same += not expected.startswith("exit") and evaluated(home) == expected
            shutil.rmtree(home)
        yield "planner", (damage.__doc__ or "").rstrip("."), f"{same} of {turns}"


def _homes(folder: Path) -> Iterator[tuple[str, Path]]:
    yield "there is no such folder, and none can be made", Path("/proc/nowhere")
    blocked = folder / "blocked"
    blocked.write_text("in the way")
    yield "a file is in its place", blocked
    if os.geteuid() == 0:
        theirs = folder / "theirs"
        (theirs / "aloft").mkdir(parents=True)
        os.chown(theirs / "aloft", 12345, -1)
        yield "it belongs to another user", theirs


if __name__ == "__main__":
    assert cache_root() is not None
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
    for row in rows(int(sys.argv[1]) if len(sys.argv) > 1 else 5, sys.argv[2:] or KINDS):
        print("| " + " | ".join(row) + " |", flush=True)
