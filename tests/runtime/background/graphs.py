"""What the tests of background blocks share: one block, in the background or in the loop with a delay."""

from pathlib import Path
from typing import Any

from aloft.files.nodes import text_of
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.loading import checked_text
from aloft.runtime.running.executor import run

PLACE = Path(__file__).parent / "graph.yaml"


def both(
    use: str,
    latency: int,
    *,
    params: dict[str, Any] | None = None,
    ticks: int = 60,
    every: int = 1,
    offset: int = 0,
    background: dict[str, Any] | None = None,
    initial: dict[str, Any] | None = None,
    clock: dict[str, Any] | None = None,
    motor: str = "",
    **keys: Any,
) -> tuple[CheckedGraph, CheckedGraph]:
    """The graph with the block in the background, and with it in the loop and a delayed wire.

    Rates are 100 Hz; the block runs in every ``every``-th tick and has a latency of so many runs. In both
    it drives a motor, whose place it reads again.
    """
    graphs = []
    for in_background in (True, False):
        block: dict[str, Any] = {
            "use": f"slow_blocks:{use}",
            "with": params or {},
            "in": {"u": "sum.y"},
            "rate": f"100/{every} Hz",
            "offset": offset,
        }
        wire: Any = "block.y"
        if in_background:
            start = {"y": initial} if initial else {}
            block["background"] = {
                "latency": f"{10 * every * latency} ms",
                **({"initial": start} if start else {}),
                **(background or {}),
            }
        else:
            wire = {"from": wire, "delay": latency, **({"initial": initial} if initial else {})}
        graph = {
            "rate": "100 Hz",
            "duration": f"{ticks / 100} s",
            **({"clock": clock} if clock else {}),
            **keys,
            "blocks": {
                "wave": {"use": "slow_blocks:Wave"},
                "sum": {
                    "use": "slow_blocks:Sum",
                    "in": {"a": "wave.y", "b": "motor.y"},
                },
                "block": block,
                "motor": {"use": "slow_blocks:Motor", "with": {"file": motor}, "in": {"u": wire}},
            },
        }
        text = "".join(f"{key}: {text_of(value)}\n" for key, value in graph.items())
        graphs.append(checked_text(text, PLACE))
    return graphs[0], graphs[1]


def run_hash_of(gain: float) -> str:
    """The hash of a run with that gain."""
    return run(both("Slow", 6, params={"gain": gain})[0]).run_hash
