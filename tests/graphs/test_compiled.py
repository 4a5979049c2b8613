"""A graph gives the same bytes compiled and as plain Python."""

from pathlib import Path

import pytest

import aloft

GRAPHS = Path(__file__).parents[2] / "graphs"


@pytest.mark.parametrize("name", ["jump", pytest.param("push", marks=pytest.mark.long)])
def test_bytes_do_not_depend_on_the_compiler(name):
    graph = aloft.load(GRAPHS / f"{name}.yaml")
    compiled = graph.run(0.1, log=False)
    plain = graph.run(0.1, log=False, plain=True)
    assert not compiled.block_warnings and not plain.block_warnings
    assert compiled.run_hash == plain.run_hash


@pytest.mark.long
@pytest.mark.parametrize("name", ["jump", "push", "somersault"])
def test_bytes_of_whole_runs_do_not_depend_on_the_compiler(name):
    graph = aloft.load(GRAPHS / f"{name}.yaml")
    compiled, plain = graph.run(log=False), graph.run(log=False, plain=True)
    assert compiled.run_hash == plain.run_hash
