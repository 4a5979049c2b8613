"""A recorded run goes on from its exact state at one instant, with other parameters.

Up to the instant the run is repeated from the last keyframe before it, as it was; its memory then is that of
the recorded run to the byte. From there a graph with other parameters goes on. The same graph goes on as the
recorded run did.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...logs.replay.replay import Replayable, Replayed, ReplayError, replay
from ...runtime.language.stages import CheckedGraph
from ...runtime.running.memory import BoundGraph
from ...runtime.running.sink import Sink
from ...runtime.running.snapshot import Snapshot


def snapshot_at(recorded: Replayable, tick: int) -> Snapshot:
    """Return the state of the recorded graph before a tick, found by running it up to there.

    Raises:
        ReplayError: the recording does not reach it, or the run does not repeat itself.
        RunError: a block could not be set up.
    """
    first, last = int(recorded.ticks[0]), int(recorded.ticks[-1])
    if not first < tick <= last:
        raise ReplayError(f"tick {tick} lies not within the recording: it has {first} to {last}")
    found: list[Snapshot] = []

    def take(bound: BoundGraph, now: int) -> None:
        if now == tick:
            taken = bound.snapshot()  # the clock has not gone on yet
            found.append(Snapshot(tick, taken.bus, taken.state))

    done = replay(recorded, inputs="seed", first_tick=tick - 1, last_tick=tick, before_tick=take)
    if done.first is not None:
        raise ReplayError(
            f"the run does not repeat itself up to tick {tick}, so no run can go on from there: "
            f"{done.first}"
        )
    if not found:
        done.result.raise_if_failed()
    return found[-1]


def branch(
    recorded: Replayable,
    tick: int,
    graph: CheckedGraph | None = None,
    *,
    until: int | None = None,
    sinks: Sequence[Sink] = (),
) -> Replayed:
    """Let a recorded run go on from a tick with another graph.

    Args:
        recorded: the run.
        tick: the tick before which it leaves the recorded one.
        graph: what goes on: the recorded graph with other parameters, by default none. Its blocks must
            remember the same.
        until: the tick before which it ends; by default as the graph says, at least with the recording.
        sinks: further sinks.

    Returns:
        The run and its differences from the recorded one, with its rows.

    Raises:
        ReplayError: the recording does not reach the tick, does not repeat itself up to it, or the graph
            remembers something else.
        RunError: a block could not be set up.
    """
    chosen = graph or recorded.graph
    if any(spec.block_type.outside == "real" for spec in chosen.blocks):
        raise ReplayError(
            "the run of a real robot cannot go on in another way; branch a simulation"
        )
    return replay(
        recorded, graph=chosen, inputs="seed", snapshot=snapshot_at(recorded, tick), last_tick=until,
        beyond=until or chosen.ticks, keep=True, sinks=sinks,
    )  # fmt: skip
