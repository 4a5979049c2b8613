"""``blocks.StateMachine``: transitions, their order and time, and its errors."""

import pytest

from aloft.blocks.general.state_machine import StateMachine
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

PARAMS = {
    "states": ["idle", "run", "rest"],
    "conditions": ["go", "halt"],
    "transitions": [
        {"from": "idle", "to": "run", "when": "go"},
        {"from": "run", "to": "rest", "when": "halt"},
        {"from": "run", "to": "idle", "when": "not go"},
        {"from": "rest", "to": "idle", "after": "0.2 s"},
    ],
}


def test_transitions_in_order_and_in_time() -> None:
    bench = BlockBench(StateMachine, PARAMS, rate=10.0)
    found = []
    for go, halt in ((0, 0), (1, 0), (1, 0), (0, 1), (0, 0), (0, 0), (1, 0), (0, 0)):
        bench.set("u", value=[bool(go), bool(halt)])
        bench.step()
        state = bench.get("state")
        assert state.value.tolist() == [k == state.index for k in range(3)]
        found.append((int(state.index), round(float(bench.get("elapsed").value[0]), 9)))
    assert found == [
        (0, 0.0), (1, 0.0), (1, 0.1), (2, 0.0), (2, 0.1), (0, 0.0), (1, 0.0), (0, 0.0),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"states": ["idle", "run"]}, "there is no state 'rest'"),
        ({"conditions": ["go", "stop"]}, "there is no condition 'halt'"),
        ({"states": ["idle", "run", "rest", "run"]}, "'run' is twice in states"),
    ],
)
def test_names_must_be_known(change: dict[str, list[str]], message: str) -> None:
    with pytest.raises(BlockError, match=message):
        BlockBench(StateMachine, {**PARAMS, **change})
