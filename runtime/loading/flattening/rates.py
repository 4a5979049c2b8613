"""Checks when every block runs: rates divide the base rate, offsets lie within a period."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from ....files.nodes import Node, ScalarNode, kind
from ....files.problems import Code, Position, Problems
from ...language.errors import AloftError
from ...language.flat_graph import FlatBlock
from ...language.schedule import hyperperiod
from ..reading.written import read_quantity


def read_period(flat: FlatBlock, base_rate: float, problems: Problems) -> int:
    """Read the ticks between two runs of a block; 1 after a problem."""
    if flat.rate is None:
        return 1
    rate = read_quantity(flat.rate, f"{flat.path}.rate", "Hz", problems)
    if rate is None:
        return 1
    ratio = base_rate / rate
    period = round(ratio)
    if period >= 1 and abs(ratio - period) <= 1e-9 * period:
        return period
    periods = [1] if ratio < 1 else [int(ratio), int(ratio) + 1]
    periods.sort(key=lambda period: abs(base_rate / period - rate))
    legal = tuple(_rate_text(base_rate, p) for p in periods)
    problems.add(
        Code.RATE,
        f"{flat.path} cannot run at {rate:.12g} Hz in a graph of {base_rate:.12g} Hz",
        flat.rate.where,
        at=f"{flat.path}.rate",
        expected=f"{base_rate:.12g} Hz divided by a whole number",
        found=f"{rate:.12g} Hz",
        nearest=legal,
        fix=f"rate: {legal[0]}",
    )
    return 1


def _rate_text(base_rate: float, period: int) -> str:
    """Format a rate to paste: as a decimal number where that is exact, else as a fraction."""
    decimal = f"{base_rate / period:.6g}"
    if abs(float(decimal) * period - base_rate) <= 1e-12 * base_rate:
        return f"{decimal} Hz"
    return f"{base_rate:.12g}/{period} Hz"


def read_offset(flat: FlatBlock, period: int, problems: Problems) -> int:
    """Read the tick of a block's first run; 0 after a problem."""
    if flat.offset is None:
        return 0
    node = flat.offset
    value = node.value if isinstance(node, ScalarNode) else None
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < period:
        return value
    problems.add(
        Code.OFFSET,
        f"{flat.path} runs every {period} ticks, so its offset cannot be {kind(node)}"
        if period > 1
        else f"{flat.path} runs in every tick, so it has no offset",
        node.where,
        at=f"{flat.path}.offset",
        expected=f"a whole number of ticks from 0 to {period - 1}" if period > 1 else "0",
        found=kind(node),
        fix="remove 'offset'"
        if period == 1 or not isinstance(value, int)
        else f"offset: {value % period}",
    )
    return 0


def wrap_offset(flat: FlatBlock, base_rate: Node | None) -> FlatBlock:
    """Reduce an offset that the use of a sub-graph gives to less than the period of the block.

    The whole sub-graph is shifted by that offset. Where this is longer than the block's period, the
    remainder after whole periods is equivalent.
    """
    node, unheard = flat.offset, Problems()
    offset = node.value if isinstance(node, ScalarNode) else None
    if node is None or not isinstance(offset, int) or isinstance(offset, bool) or offset < 0:
        return flat
    base = read_quantity(base_rate, "rate", "Hz", unheard) if base_rate is not None else None
    period = read_period(flat, base, unheard) if base is not None else 1
    if len(unheard) or base is None:
        return flat  # what is wrong is reported when the rates are read
    return replace(flat, offset=ScalarNode(offset % period, node.where))


def check_hyperperiod(periods: Iterable[int], where: Position, problems: Problems) -> None:
    """Report rates whose hyperperiod, the number of ticks after which they repeat, is too long."""
    try:
        hyperperiod(periods)
    except AloftError as error:
        message, _, fix = str(error).partition(". ")
        problems.add(Code.RATE, message, where, at="rate", fix=fix[:1].lower() + fix[1:])
