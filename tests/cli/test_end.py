"""A command ends its process at once, with its code and all that it printed, and calls what asked for it."""

from __future__ import annotations

import subprocess
import sys

import pytest

START = """
import atexit, os, sys, threading
import aloft.cli
sys.argv = ["aloft", *ARGUMENTS]
at_once = os._exit
os._exit = lambda code: (print("at once", flush=True), at_once(code))
atexit.register(lambda: print("asked for"))
BEFORE
aloft.cli.main()
"""


def ended(before: str = "", arguments: tuple[str, ...] = ("--version",)) -> tuple[int, list[str]]:
    """The exit code, and the last lines that a command prints."""
    text = START.replace("ARGUMENTS", repr(arguments)).replace("BEFORE", before)
    done = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, timeout=120, check=False
    )
    return done.returncode, done.stdout.splitlines()


@pytest.mark.parametrize("arguments", (("--version",), ("check", "no_such_graph.yaml")))
def test_it_ends_with_its_code_and_calls_what_asked_for_it(arguments: tuple[str, ...]) -> None:
    code, lines = ended(arguments=arguments)
    assert code == (0 if arguments[0] == "--version" else 2)
    assert lines[-2:] == ["asked for", "at once"]


@pytest.mark.parametrize(
    "before",
    (
        "threading.Thread(target=threading.Event().wait, daemon=True).start()",
        "sys.setprofile(lambda *_: None)",
        "sys.settrace(lambda *_: None)",
    ),
)
def test_threads_profilers_and_tracers_let_it_end_as_python_does(before: str) -> None:
    code, lines = ended(before)
    assert code == 0
    assert lines[-1] == "asked for"
