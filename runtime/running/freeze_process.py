"""Separate program that ends a run whose compiled code does not release the interpreter.

Such code (an endless loop in a solver, or in a function compiled to machine code) lets no thread of
Python run, so nothing in the process of the run can help. This process hears a beat from a thread
there. When the beats stop, it asks with a signal for the stacks of all threads, which Python's
fault handler writes without the interpreter, reports which block hangs and where, and kills the
process. It counts its own looks instead of reading a clock, so that a suspended process does not
seem to hang.

It knows nothing of aloft, so it starts fast, and nothing that the graph imports can fail in it::

    python freeze_process.py SOCKET PID LIMIT_IN_SECONDS AS_JSON FILE_NUMBER

The pipe on its standard input brings first the blocks, as a line of JSON, and then beats and stacks.
A file in memory has the place in the order of the block that a chain runs: the stack shows only the
chain.
"""

from __future__ import annotations

import ast
import json
import os
import re
import select
import signal
import sys
from contextlib import suppress

LOOKS = 8
"""Looks in every limit of time."""
ANSWER_TIME = 1.0
"""Seconds that the fault handler has to write the stacks."""
_FRAME = re.compile(r'^  File "(?P<file>[^"]*)", line (?P<line>\d+) in (?P<name>.*)$')


def main() -> int:
    """Watch until the pipe ends, or until the beats stop."""
    pid, limit, as_json = int(sys.argv[2]), float(sys.argv[3]), sys.argv[4] == "1"
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # meant for the run
    head = b""
    while not head.endswith(b"\n"):
        letter = os.read(0, 1)
        if not letter:
            return 0
        head += letter
    description = json.loads(head)
    silent = 0
    while True:
        piece = _read(limit / LOOKS)
        if piece is None:
            silent += 1
        elif not piece:
            return 0
        else:
            silent = 0
        if silent > LOOKS:
            silent = 0
            stacks = _stacks(pid)
            if stacks:
                _report(description, stacks, limit, as_json)
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
                return 3


def _read(seconds: float) -> bytes | None:
    """Read the data that come within that time: ``None`` if there are none, empty at the end of the
    pipe."""
    ready, _, _ = select.select([0], [], [], seconds)
    return os.read(0, 1 << 16) if ready else None


def _stacks(pid: int) -> str:
    """Return the stacks of all threads; empty where the process is suspended, or goes on after
    all."""
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGUSR1)
    text = b""
    while piece := _read(ANSWER_TIME):
        text += piece
    found = text.decode(errors="replace")
    return found if "(most recent call first)" in found and not found.endswith(".") else ""


def _report(description: dict[str, object], stacks: str, limit: float, as_json: bool) -> None:
    """Print which block hangs and where."""
    frames = _run_frames(stacks)
    own = [f for f in frames if not _is_installed(f[0], description)]
    file, line, _ = (own or frames or [("", 0, "")])[0]
    blocks = _blocks(description, frames) or _in_chain(description, frames)
    who = "block " + " or ".join(f"'{path}'" for path in blocks) if blocks else "the run"
    reason = (
        f"{who} hangs in compiled code that lets nothing else run: no sign of life for {limit:g} s "
        "(clock.hangs_after allows longer); the process is killed"
    )
    place = f"{file}:{line}" if file else ""
    place = " or ".join(dict.fromkeys(_loops(description, blocks))) or place
    sys.stderr.write(f"\nno success: {reason}\n" + (f"  it is at {place}\n" if place else ""))
    if as_json:
        block = blocks[0] if len(blocks) == 1 else ""
        error = {"message": reason, "block": block, "tick": -1, "where": place, "traceback": stacks}
        outcome = {
            "graph": description["graph"],
            "success": False,
            "reason": reason,
            "error": error,
        }
        print(json.dumps({**outcome, "exit_code": 128 + signal.SIGKILL}), flush=True)


def _run_frames(stacks: str) -> list[tuple[str, int, str]]:
    """File, line and function of the frames within the control loop, innermost first."""
    for part in re.split(r"^(?:Current thread|Thread) .*$", stacks, flags=re.MULTILINE):
        found = [m for text in part.splitlines() if (m := _FRAME.match(text))]
        frames = [(m["file"], int(m["line"]), m["name"]) for m in found]
        loop = [i for i, f in enumerate(frames) if f[2] == "advance" and "ticker.py" in f[0]]
        if loop:
            return frames[: loop[0]]
    return []


def _is_installed(file: str, description: dict[str, object]) -> bool:
    prefixes = description["installed"]
    assert isinstance(prefixes, list)
    return file.startswith(tuple(prefixes)) or "site-packages" in file


def _blocks(description: dict[str, object], frames: list[tuple[str, int, str]]) -> list[str]:
    """Return the paths of the blocks whose class has the outermost frame that belongs to a
    block."""
    known = description["blocks"]
    assert isinstance(known, list)
    for file, line, _ in reversed(frames):
        inside = _class_at(file, line) if any(of == file for _, of, _ in known) else ""
        found = [path for path, of, name in known if of == file and name == inside]
        if found:
            return found
    return []


def _in_chain(description: dict[str, object], frames: list[tuple[str, int, str]]) -> list[str]:
    """Return the path of the block that a chain runs, if the innermost frame is a chain's."""
    order, shared = description["order"], int(sys.argv[5])
    assert isinstance(order, list)
    if shared < 0 or not frames or frames[0][2] != "run" or "call_sequence.py" not in frames[0][0]:
        return []
    place = int.from_bytes(os.pread(shared, 8, 0), sys.byteorder, signed=True)
    return order[place : place + 1] if place >= 0 else []


def _loops(description: dict[str, object], blocks: list[str]) -> list[str]:
    """Return the places of the loops in the kernels of users' blocks, which may have no end: those with
    ``while``, or where there is none those with ``for``."""
    kernels = description.get("kernels", {})
    assert isinstance(kernels, dict)
    found: dict[type, list[str]] = {ast.While: [], ast.For: []}
    for file, first in (each for path in blocks for each in kernels.get(path, ())):
        try:
            with open(file, encoding="utf-8") as source:
                tree = ast.parse(source.read())
        except (OSError, SyntaxError, ValueError):
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and first in (
                node.lineno,
                *(each.lineno for each in node.decorator_list),
            ):
                for each in ast.walk(node):
                    if type(each) in found:
                        found[type(each)].append(f"{file}:{each.lineno}")  # type: ignore[attr-defined]  # a loop
    return found[ast.While] or found[ast.For]


def _class_at(file: str, line: int) -> str:
    """Return the name of the class whose text has that line."""
    try:
        with open(file, encoding="utf-8") as source:
            tree = ast.parse(source.read())
    except (OSError, SyntaxError, ValueError):
        return ""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and node.lineno <= line <= (node.end_lineno or 0):
            return node.name
    return ""


if __name__ == "__main__":
    sys.exit(main())
