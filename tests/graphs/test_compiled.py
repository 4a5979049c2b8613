"""A graph gives the same bytes compiled and as plain Python."""

from pathlib import Path

import pytest

import aloft

GRAPHS = Path(__file__).parents[2] / "graphs"


def test_bytes_do_not_depend_on_the_compiler():
    graph = aloft.load(GRAPHS / "jump.yaml")
    compiled = graph.run(0.06, log=False)
    plain = graph.run(0.06, log=False, plain=True)
    assert not compiled.block_warnings and not plain.block_warnings
    assert compiled.run_hash == plain.run_hash


@pytest.mark.long
def test_bytes_of_a_whole_run_do_not_depend_on_the_compiler():
    graph = aloft.load(GRAPHS / "push.yaml")
    compiled, plain = graph.run(log=False), graph.run(log=False, plain=True)
    assert compiled.run_hash == plain.run_hash
