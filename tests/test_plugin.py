"""A package of somebody else's, really installed by pip, brings a block that graphs use by name."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

PROJECT = """
[build-system]
requires = ["setuptools"]
build-backend = "setuptools.build_meta"

[project]
name = "springs"
version = "1.0"

[project.entry-points."aloft.blocks"]
"springs.Spring" = "springs.spring:Spring"

[tool.setuptools]
packages = ["springs"]
"""
BLOCK = '''
from aloft.runtime.language.block import Block, Input, Output
from aloft.runtime.language.parameters import Parameters, parameter
from aloft.blocks.general.vectors import Vector


class Spring(Block):
    """The force of a spring."""

    class Params(Parameters):
        stiffness: float = parameter(1.0, unit="N/m", gt=0.0, text="force per length")

    params: Params
    stretch = Input(Vector, text="how far it is stretched [m]")
    force = Output(Vector, text="what it pulls back with [N]")

    def step(self) -> None:
        self.force.value[...] = -self.params.stiffness * self.stretch.value

    def metrics(self) -> dict[str, float]:
        return {"last_force_N": float(self.force.value[0])}
'''
GRAPH = """
rate: 100 Hz
duration: 0.1 s
dimensions: {n: 1}
blocks:
  stretch: {use: blocks.Constant, with: {value: [0.5]}}
  spring: {use: springs.Spring, with: {stiffness: 30 N/cm}, in: {stretch: stretch.y}}
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which the package is installed, from its sources and with no network."""
    folder = tmp_path_factory.mktemp("plugin")
    package = folder / "project" / "springs"
    package.mkdir(parents=True)
    (folder / "project" / "pyproject.toml").write_text(PROJECT)
    (package / "__init__.py").write_text("")
    (package / "spring.py").write_text(BLOCK)
    target = folder / "site"
    options = ["--quiet", "--no-deps", "--no-index", "--no-build-isolation"]
    subprocess.run(
        [sys.executable, "-m", "pip", "install", *options, "--target", target, folder / "project"],
        check=True, capture_output=True, timeout=240,
    )  # fmt: skip
    (folder / "graph.yaml").write_text(GRAPH)
    return target


def aloft(installed: Path, *arguments: str, code: int = 0) -> str:
    """The command line, with and only with that folder behind the usual ones."""
    path = os.pathsep.join([*filter(None, [os.environ.get("PYTHONPATH")]), str(installed)])
    done = subprocess.run(
        [sys.executable, "-c", "from aloft.cli import main; main()", *arguments],
        cwd=installed.parent, env={**os.environ, "PYTHONPATH": path},
        capture_output=True, text=True, check=False, timeout=240,
    )  # fmt: skip
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout


@pytest.mark.long
def test_a_graph_runs_the_block_of_an_installed_package(installed: Path) -> None:
    result = json.loads(aloft(installed, "run", "graph.yaml", "--no-record", "--json"))
    assert result["success"] is True
    assert result["metrics"]["last_force_N"] == -1500.0


@pytest.mark.long
def test_its_mistakes_are_reported_as_those_of_our_own_blocks(installed: Path) -> None:
    graph = (installed.parent / "graph.yaml").read_text()
    wrong = graph.replace("30 N/cm", "30 kg")
    (installed.parent / "wrong.yaml").write_text(wrong)
    report = json.loads(aloft(installed, "check", "wrong.yaml", "--json", code=2))
    (problem,) = report["problems"]
    assert (problem["code"], problem["at"]) == ("bad-parameter", "spring.stiffness")
    (installed.parent / "wrong.yaml").write_text(graph.replace("springs.Spring", "springs.Sprign"))
    report = json.loads(aloft(installed, "check", "wrong.yaml", "--json", code=2))
    assert report["problems"][0]["nearest"] == ["springs.Spring"]


@pytest.mark.long
def test_it_is_listed_and_its_contract_is_shown(installed: Path) -> None:
    assert "springs.Spring" in aloft(installed, "blocks")
    assert "The force of a spring." in aloft(installed, "blocks", "springs.Spring")
