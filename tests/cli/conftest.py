"""What the tests of the command line share: a folder to work in, and ways to call it."""

import io
import json
import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pytest

from aloft.cli import run_arguments

from ..counting import copy_counting

Call = Callable[..., subprocess.CompletedProcess[str]]
"""The type of ``run_here``."""
CallJson = Callable[..., dict[str, Any]]
"""The type of ``run_for_json``."""
Start = Callable[..., subprocess.Popen[str]]
"""The type of ``run_elsewhere``."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a graph and its block, which is where commands run."""
    copy_counting(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def counted(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The recording of ``count.yaml`` as it stands: made once, as that takes a second."""
    folder = tmp_path_factory.mktemp("counted")
    copy_counting(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        run_here("run", "count.yaml", "--record", "count.rrd", "--quiet")
    return (folder / "count.rrd").read_bytes()


def outcome(*arguments: str, columns: int = 160) -> subprocess.CompletedProcess[str]:
    """Run the command line in this process; how it would leave, and what it printed."""
    output, errors = io.StringIO(), io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        redirect_stdout(output),
        redirect_stderr(errors),
        pytest.raises(SystemExit) as left,
    ):
        patch.setattr(sys, "argv", ["aloft", *arguments])
        patch.setenv("COLUMNS", str(columns))
        run_arguments()
    assert isinstance(left.value.code, int)
    return subprocess.CompletedProcess(
        arguments, left.value.code, output.getvalue(), errors.getvalue()
    )


def run_here(*arguments: str, code: int = 0) -> subprocess.CompletedProcess[str]:
    """As ``outcome``, and check how it would leave."""
    done = outcome(*arguments)
    assert done.returncode == code, done.stdout + done.stderr
    return done


def run_for_json(*arguments: str, code: int = 0) -> dict[str, Any]:
    """As ``run_here``; standard output must be one JSON object on one line and nothing else."""
    return _the_object(run_here(*arguments, "--json", code=code))


def _the_object(done: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    lines = done.stdout.splitlines()
    assert len(lines) == 1
    value = json.loads(lines[0])
    assert isinstance(value, dict)
    return value


def run_parts_for_json(*arguments: str, code: int = 0) -> dict[str, Any]:
    """As ``run_for_json``, of a run with ``--local``, in a process of its own."""
    done = outcome(*arguments, "--json")
    assert done.returncode == code, done.stdout + done.stderr
    return _the_object(done)


def run_elsewhere(*arguments: str, before: str = "", **environment: str) -> subprocess.Popen[str]:
    """Start the command line in a process of its own, after the statement ``before``."""
    code = f"{before}\nfrom aloft.cli import main\nmain()"
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **environment},
    )


@pytest.fixture
def call() -> Call:
    """See ``run_here``."""
    return run_here


@pytest.fixture
def call_json() -> CallJson:
    """See ``run_for_json``."""
    return run_for_json


@pytest.fixture
def start() -> Start:
    """See ``run_elsewhere``."""
    return run_elsewhere
