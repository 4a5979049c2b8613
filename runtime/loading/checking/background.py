"""Checks how a block works in the background, and puts in its place what stands for it in the graph."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ....files.nodes import MapNode, plain, text_of
from ....files.problems import Code, Problems, listing, nearest
from ...language.block import Block
from ..reading.graph_file import BackgroundKeys, read_section
from .block_check import BlockDraft
from .inserted import read_values

MOST_UNDER_WAY = 1000
"""Runs of a block that may be under way."""


def move_to_background(draft: BlockDraft, base_rate: float, problems: Problems) -> None:
    """Move the block to the background, if the graph declares that it works there."""
    node, kind = draft.flat.background, draft.block_type
    if node is None or kind is None:
        return
    path = draft.flat.path
    found = len(problems)
    given = read_section(node, f"{path}.background", BackgroundKeys, problems)
    _check_kind(draft, kind, node, problems)
    latency = _read_latency(draft, node, given, base_rate, problems)
    initial = _read_initial(draft, node, problems)
    if latency is None or len(problems) > found:
        return
    late = {"late": given["late"]} if "late" in given else {}
    from ...background.background_block import Background, background_block_type

    background = Background(latency, initial=initial, **late)
    draft.block_type = background_block_type(kind, background)


def _check_kind(draft: BlockDraft, kind: type[Block], node: MapNode, problems: Problems) -> None:
    """Report a block that belongs on the control thread."""
    if kind.outside != "no":
        reason = "its outputs come from outside the graph"
    elif kind.stop_cycle is not Block.stop_cycle:
        reason = "it brings actuators to rest"
    elif hasattr(kind, "wait"):
        reason = "it drives the clock"
    elif kind.__name__ == "External":
        reason = "Python sets its output between two ticks"
    else:
        return
    problems.add(
        Code.BACKGROUND,
        f"{draft.flat.path} ({draft.flat.use}) cannot work in the background: {reason}",
        node.where,
        at=f"{draft.flat.path}.background",
        fix="remove 'background'",
    )


def _read_latency(
    draft: BlockDraft, node: MapNode, given: Mapping[str, Any], base_rate: float, problems: Problems
) -> int | None:
    """Read the latency in runs of the block."""
    entry = node.get("latency")
    path = draft.flat.path
    period = draft.period_ticks / base_rate
    shown = _milliseconds(period)
    if entry is None:
        problems.add(
            Code.MISSING_KEY,
            f"{path} works in the background, and does not say its latency",
            node.where,
            at=f"{path}.background",
            expected=f"a multiple of its period of {shown}",
            fix=f"background: {{latency: {shown}}}",
        )
        return None
    latency = given.get("latency")
    if latency is None:
        return None
    ratio = float(latency) / period
    runs = round(ratio)
    if 1 <= runs <= MOST_UNDER_WAY and abs(ratio - runs) <= 1e-9 * runs:
        return runs
    legal = tuple(dict.fromkeys(max(1, runs) for runs in (int(ratio), int(ratio) + 1)))
    texts = tuple(_milliseconds(runs * period) for runs in legal)
    if runs > MOST_UNDER_WAY:
        texts = (_milliseconds(MOST_UNDER_WAY * period),)
    problems.add(
        Code.BACKGROUND,
        f"the outputs of {path}, which runs every {shown}, cannot appear after "
        f"{_milliseconds(latency)}",
        entry.value.where,
        at=f"{path}.background.latency",
        expected=f"a multiple of {shown}, up to {_milliseconds(MOST_UNDER_WAY * period)}",
        found=text_of(plain(entry.value)),
        nearest=texts,
        fix=f"latency: {texts[-1]}",
    )
    return None


def _read_initial(
    draft: BlockDraft, node: MapNode, problems: Problems
) -> dict[str, dict[str, Any]]:
    """Read the outputs before the first result."""
    entry = node.get("initial")
    found: dict[str, dict[str, Any]] = {}
    if entry is None or not isinstance(entry.value, MapNode):
        return found
    for item in entry.value:
        at = f"{draft.flat.path}.background.initial.{item.key}"
        output = draft.outputs.get(item.key)
        if output is None:
            similar = nearest(item.key, draft.outputs)
            problems.add(
                Code.INITIAL,
                f"{draft.flat.path} has no output {item.key!r}",
                item.key_where,
                at=at,
                expected=listing(draft.outputs),
                found=item.key,
                nearest=similar,
                fix=similar[0] if similar else f"remove {item.key!r}",
            )
        elif isinstance(item.value, MapNode):
            found[item.key] = read_values(item.value, output.signal, draft, at, problems)
    return found


def _milliseconds(seconds: float) -> str:
    return f"{seconds * 1e3:.9g} ms"
