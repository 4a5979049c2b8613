"""Blocks of every kind that ship give in the background what they give in the loop, to the byte."""

from pathlib import Path
from typing import Any

import pytest

from aloft.robots.description import find_robot
from aloft.runtime.background.background_block import Background, background_block_type
from aloft.runtime.language.block import Block
from aloft.runtime.language.registry import find_block, known_names
from aloft.runtime.testing.conformance import Subject, unmet_messages

LATENCY, RUNS, KEPT = 3, 10, 6
SHIPPED = [n for n in known_names() if n.startswith("blocks.") and n != "blocks.External"]
KEEPING = [n for n in SHIPPED if find_block(n).save_state is not Block.save_state]
NAMES = sorted({*KEEPING, *SHIPPED[::4]})
"""Those that keep anything outside of their states, and a quarter of the others, which takes a process each."""


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_any_block_can_be_moved_to_the_background(name: str) -> None:
    kind, robot = find_block(name), find_robot("bruce")
    params = kind.example_parameters()
    if unmet_messages(kind, params, robot=robot):
        pytest.skip("BRUCE does not have what it needs")
    ready = kind.Params.model_validate(dict(params))
    special = kind.specialize(ready, Path(), robot)

    def subject(block_type: type[Block]) -> Subject:
        return Subject(block_type, params, robot, 500.0, {}, 1)

    def outputs(bench: Any) -> list[bytes]:
        return [v.tobytes() for port in special.outputs for _, v in bench.get(port)]

    in_loop = subject(special)
    in_background = subject(background_block_type(special, Background(LATENCY)))
    expected = []
    with in_loop.bench() as bench:
        for _ in in_loop.feed(bench, RUNS):
            bench.step()
            expected.append(outputs(bench))
    with in_background.bench() as bench:
        for run in in_background.feed(bench, RUNS):
            bench.step()
            assert run < LATENCY or outputs(bench) == expected[run - LATENCY], run
            if run == KEPT:
                snapshot = bench.snapshot()
        bench.restore(snapshot)
        for run in in_background.feed(bench, RUNS):
            if run > KEPT:
                bench.step()
                assert outputs(bench) == expected[run - LATENCY], f"restored, {run}"
