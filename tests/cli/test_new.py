"""``aloft new``: what it writes works, tests included, and it overwrites nothing."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from aloft.runtime.loading import check

from .conftest import Call


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def passing_tests(folder: Path) -> int:
    """How many tests in a folder pass; none may fail."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    done = subprocess.run(  # noqa: PLW1510
        command, cwd=folder, capture_output=True, text=True, timeout=300, env={**os.environ}
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return int(done.stdout.split(" passed")[0].split()[-1])


@pytest.mark.long
def test_a_project_with_a_block_and_a_graph_and_a_robot_passes_its_tests(
    here: Path, call: Call
) -> None:
    done = call("new", "project", "my_robot")
    assert done.stdout.splitlines()[-1] == "next: cd my_robot; aloft run graph.yaml; pytest"
    call("new", "block", "LegSpring", "--in", "my_robot")
    call("new", "graph", "loop", "--in", "my_robot")
    call("new", "robot", "pendulum", "--in", "my_robot")
    for name in ("graph", "loop", "pendulum_hold"):
        report = check(here / "my_robot" / f"{name}.yaml")
        assert report.ok, report.text()
    assert passing_tests(here / "my_robot") == 6
    settings = json.loads((here / "my_robot" / ".vscode" / "settings.json").read_text())
    ((schema, graphs),) = settings["yaml.schemas"].items()
    assert (here / "my_robot" / schema).is_file()
    assert all((here / "my_robot" / name).is_file() for name in graphs)


def test_the_project_runs_from_its_folder(
    here: Path, call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    call("new", "project", "mine")
    monkeypatch.chdir(here / "mine")
    assert "success: ran to its end" in call("run", "graph.yaml", "--no-record").stdout
    assert call("blocks", "smoother:Smoother").stdout.startswith("smoother:Smoother")


def test_nothing_is_overwritten(here: Path, call: Call) -> None:
    call("new", "graph", "loop")
    (here / "loop.yaml").write_text("mine")
    done = call("new", "graph", "loop", code=2)
    assert "loop.yaml would be overwritten; nothing was written" in done.stderr
    assert (here / "loop.yaml").read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("block", "leg-spring"), "a block cannot be called 'leg-spring', which is no name of a class; for instance LegSpring"),
        (("block", "class"), "for instance Class"),
        (("graph", "my loop"), "'my loop' is no name of letters, digits and _; for instance my_loop"),
        (("robot", "1"), "'1' is no name of letters, digits and _"),
    ],
)  # fmt: skip
def test_names_that_cannot_be(
    here: Path, call: Call, arguments: tuple[str, ...], message: str
) -> None:
    assert message in call("new", *arguments, code=2).stderr
    assert not list(here.iterdir())


def test_a_file_in_the_way_is_an_error(here: Path, call: Call) -> None:
    (here / "taken").write_text("")
    assert "cannot write" in call("new", "project", "taken", code=2).stderr
