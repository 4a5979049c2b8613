"""Damages what is kept in the cache folder, in every way and kind, and counts the runs that are as before.

``python -m aloft.lab.robustness.caches 5 kernels`` prints the rows of a kind, each tried five times; without kinds all of
``KINDS``. Each run plans a jump and does it, in a process of its own, with a copy of a cache folder that a
whole run has filled. It counts if it ends with success and the hash of a run without any cache.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

SEED = 54
HEAD = ("what is damaged", "how", "runs as before")
KINDS = ("kernels", "expansions", "processors", "arrays", "checked", "planner", "plans", "folder")

Damage = Callable[[list[Path], random.Random], None]


def flip(found: list[Path], draw: random.Random) -> None:
    """Flip one bit in every file."""
    for path in found:
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
    if len(found) == 1:
        found = [*found, next(p for p in found[0].parents[1].rglob("*.npz") if p not in found)]
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


READ_ONLY = 'mount --bind "$0" "$0" && mount -o remount,ro,bind "$0" && exec "$@"'


def jump(
    cache: Path, rise: int = 133, *, read_only: bool = False, until: float | None = None
) -> str:
    """Return the hash of a planned jump with this cache folder; the exit code where it failed.

    Args:
        cache: the folder, which is the home, too.
        rise: how high it jumps [mm].
        read_only: whether nothing can be written there.
        until: the time [s] after which the run is killed.
    """
    words = [sys.executable, "-m", "aloft", "jump", "--rise", f"{rise} mm", "--no-record", "--json"]
    if read_only and os.geteuid() == 0:  # the modes of files do not hold root back
        words = ["unshare", "--mount", "sh", "-c", READ_ONLY, str(cache), *words]
    elif read_only:
        for each in [cache, *cache.rglob("*")]:
            each.chmod(each.stat().st_mode & ~0o222)
    env = {**os.environ, "XDG_CACHE_HOME": str(cache), "HOME": str(cache)}
    try:
        done = subprocess.run(
            words, check=False, env=env, capture_output=True, text=True, timeout=until or 600.0
        )
    except subprocess.TimeoutExpired:
        return "killed"
    return (
        f"exit code {done.returncode}" if done.returncode else json.loads(done.stdout)["run_hash"]
    )


def rows(turns: int, kinds: Sequence[str]) -> Iterator[Sequence[str]]:
    """Return the rows of the table."""
    draw = random.Random(SEED)
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole"
        whole.mkdir()
        expected = jump(Path("/proc/nowhere"))
        began = time.monotonic()
        first = jump(whole)
        longest = time.monotonic() - began
        jump(whole, 60)  # a second plan
        if first != expected or expected.startswith("exit"):
            raise SystemExit(f"with a new cache folder: {first}; without one: {expected}")

        def tried(kind: str, damage: Damage | None) -> bool:
            home = Path(folder) / "copy"
            shutil.copytree(whole, home)
            if kind == "planner":  # with the plan nobody asks for the planner's functions
                shutil.rmtree(home / "aloft" / "plans")
            found = [p for p in sorted((home / "aloft" / kind).rglob("*")) if p.is_file()]
            if damage is not None:
                damage(found, draw)
            else:
                shutil.rmtree(home / "aloft" / kind)
                jump(home, until=draw.uniform(0.2, longest))
            same = bool(found) and jump(home) == expected
            shutil.rmtree(home)
            return same

        for kind in (kind for kind in KINDS[:-1] if kind in kinds):
            for damage in (*DAMAGES, None):
                how = "Kill the run that fills it" if damage is None else damage.__doc__ or ""
                same = sum(tried(kind, damage) for _ in range(turns))
                yield kind, how.rstrip("."), f"{same} of {turns}"
        for name, home, read_only in _homes(Path(folder), whole) if "folder" in kinds else ():
            found = jump(home, read_only=read_only)
            yield "the cache folder", name, f"{int(found == expected)} of 1"


def _homes(folder: Path, whole: Path) -> Iterator[tuple[str, Path, bool]]:
    yield "there is no such folder, and none can be made", Path("/proc/nowhere"), False
    blocked = folder / "blocked"
    blocked.write_text("in the way")
    yield "a file is in its place", blocked, False
    bare = folder / "bare"
    bare.mkdir()
    yield "it is empty and cannot be written", bare, True
    yield "it is full and cannot be written", whole, True
    if os.geteuid() == 0:
        theirs = folder / "theirs"
        (theirs / "aloft").mkdir(parents=True)
        os.chown(theirs / "aloft", 12345, -1)
        yield "it belongs to another user", theirs, False


if __name__ == "__main__":
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
    for row in rows(int(sys.argv[1]) if len(sys.argv) > 1 else 5, sys.argv[2:] or KINDS):
        print("| " + " | ".join(row) + " |", flush=True)
