"""Shipped kernels are NumPy's on the arguments of real runs; see ``lab/judge_shipped_kernels.py``."""

from __future__ import annotations

import pytest

from aloft.lab.judge_shipped_kernels import (
    GRAPHS,
    Samples,
    judge,
    record_drawn,
    record_graph,
    steps_of_blocks,
)
from aloft.runtime.testing.numpy_oracle import copied


@pytest.fixture(scope="module")
def jumping() -> Samples:
    """What the kernels of the first ticks of a jump got and made."""
    samples: Samples = {}
    record_graph("jump", 0.004, samples)
    for name in ("blocks.PID", "blocks.LookupTable", "blocks.StateMachine"):
        record_drawn(name, samples)
    return samples


def test_the_kernels_of_a_jump_are_numpys(jumping: Samples) -> None:
    verdict = judge(jumping)
    assert not verdict.wrong, verdict.wrong
    assert not verdict.refusals
    assert len(verdict.numpy) >= 57


def test_another_number_is_seen(jumping: Samples) -> None:
    name = "aloft.blocks.control.joint_pd.JointPD.step"
    sample = jumping[name][0]
    after = copied(sample.after)
    (command,) = (each for each in after if type(each).__name__ == "JointCommand")
    command.torque[2] += 1e-9
    wrong = judge({name: [sample._replace(after=after)]}).wrong
    assert [text.partition(name)[0] for text in wrong] == [
        "",
        "machine code of ",
        "fused machine code of ",
    ]
    assert "where NumPy has" in wrong[0]


@pytest.mark.long
def test_the_kernels_of_tasks_are_numbas(jumping: Samples) -> None:
    tasks = {name: rows[-1:] for name, rows in jumping.items() if ".control.tasks." in name}
    verdict = judge(tasks, numba=True)
    assert not verdict.wrong, verdict.wrong
    assert len(+verdict.numba) >= 8, verdict.numba


@pytest.mark.long
def test_the_steps_of_all_shipped_blocks_are_numpys() -> None:
    samples: Samples = {}
    for graph, duration in GRAPHS.items():
        record_graph(graph, min(duration, 0.4), samples)
    steps = steps_of_blocks()
    for block, names in steps.items():
        if not all(each in samples for each in names):
            record_drawn(block, samples)
    verdict = judge(samples)
    assert not verdict.wrong, verdict.wrong[:5]
    assert {each for names in steps.values() for each in names} <= {*verdict.numpy}
