"""Requests to a running graph's parameters that were made and damaged at random.

Each has an answer in JSON, most of them an error, and the next request is answered. The number of
tries is small so that the test takes a bounded time; ``ALOFT_FUZZ=100000`` makes it longer.
"""

import json
import os
import random
from typing import Any

from aloft.blocks.general.arithmetic import Gain
from aloft.blocks.general.sources import SineWave
from aloft.runtime.live.parameter_endpoint import _answer
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.run_control import RunControl
from aloft.runtime.testing import BlockUse, checked_graph

TRIES = int(os.environ.get("ALOFT_FUZZ", "800"))
VALUES = (
    "0.5", "1e400", "-.inf", ".nan", "high", "[1, 2]", "{a: 1}", "null", "'", "&a [*a]", "!!python/x 1",
    "0x1F", "1_000", "2020-01-01", "9" * 400, "[" * 300, "!!binary x", "? 1", "*b", "0o9", "1:30:00",
)  # fmt: skip
NAMES = (
    "gain.gain", "gain", "", "wave.frequency", "gain.gain.gain", ".", "gain/gain", "\x00", "gain.gain ", "ä.b",
)  # fmt: skip


def request(draw: random.Random) -> bytes:
    """A request that may be good, with what people, programs and cables make of one."""
    settings = [f"{draw.choice(NAMES)}={draw.choice(VALUES)}" for _ in range(draw.randrange(4))]
    message = {
        "verb": draw.choice(["set", "set", "list", "watch", "", None, 3]),
        "settings": settings,
    }
    kind = draw.randrange(6)
    if kind == 0:
        message["settings"] = draw.choice([5, None, "gain.gain=1", [None], [["a"]], {"a": 1}])
    data = bytearray(json.dumps(message).encode())
    if kind == 1:
        for _ in range(draw.randrange(1, 4)):
            data[draw.randrange(len(data))] = draw.randrange(256)
    elif kind == 2:
        del data[draw.randrange(len(data)) :]
    elif kind == 3:
        data[draw.randrange(len(data)) : 0] = draw.choice([b"[", b"{", b'"']) * 60_000
    return bytes(data)


def starting() -> dict[str, Any]:
    """What somebody who wants to watch is told before the run has begun."""
    return {"starting": True}


def test_every_request_has_an_answer_and_the_next_one_too() -> None:
    bound = BoundGraph(
        checked_graph({"wave": BlockUse(SineWave), "gain": BlockUse(Gain, wires={"u": "wave.y"})})
    )
    bound.parameters.submit = lambda adjustment: None  # type: ignore[method-assign]
    control = RunControl()
    control.open(bound)
    draw = random.Random(11)
    kinds = {"error": 0, "parameters": 0, "changes": 0, "starting": 0}
    for _ in range(TRIES):
        data = request(draw)
        answer = _answer(data, bound.parameters, "g", starting, control)
        assert json.loads(json.dumps(answer)) is not None
        (kind,) = set(kinds) & set(answer)
        kinds[kind] += 1
    assert min(kinds.values()) > 0
    good = _answer(
        b'{"verb": "set", "settings": ["gain.gain=0.5"]}', bound.parameters, "g", starting, control
    )
    assert good["changes"][0]["new"] == 0.5
