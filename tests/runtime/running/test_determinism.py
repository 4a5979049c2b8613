"""The same graph gives the same bytes in every process, whatever the hash seed and the log."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import sys
from aloft.runtime.running.executor import run
from aloft.blocks.general.arithmetic import Gain
from aloft.blocks.general.integrators_and_delays import Integrator
from aloft.blocks.general.sources import SineWave
from aloft.blocks.general.arithmetic import Sum
from aloft.runtime.language.stages import Wire
from aloft.runtime.testing.graphs import BlockUse, checked_graph

blocks = {"wave": BlockUse(SineWave, {"n": 5, "frequency": 3.7})}
for i in range(30):
    source = f"level{i - 1}.y" if i else "wave.y"
    blocks[f"error{i}"] = BlockUse(
        Sum, {"n": 5, "weights": [1.0, -1.0]}, {"a": source, "b": f"level{i}.y"}, 1 + i % 3
    )
    blocks[f"gain{i}"] = BlockUse(
        Gain, {"n": 5, "gain": 9.1}, {"u": Wire(f"error{i}.y", "", i % 3)}, 1 + i % 2
    )
    blocks[f"level{i}"] = BlockUse(Integrator, {"n": 5}, {"u": f"gain{i}.y"})
result = run(checked_graph(blocks, ticks=400), log=sys.argv[1] == "log")
assert result.success, result.reason
print(result.run_hash, " ".join(result.blocks))
"""


def run_program(seed: str, log: str) -> str:
    environment = {**os.environ, "PYTHONHASHSEED": seed}
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, log],
        env=environment, capture_output=True, text=True, check=True, timeout=240,
    ).stdout  # fmt: skip


@pytest.fixture(scope="module")
def reference() -> str:
    return run_program("0", "log")


@pytest.mark.long
@pytest.mark.parametrize(("seed", "log"), [("0", "none"), ("1", "log"), ("random", "none")])
def test_equal_hash_and_order_in_every_process(reference: str, seed: str, log: str) -> None:
    assert run_program(seed, log) == reference
    assert len(reference.split()[0]) == 32
