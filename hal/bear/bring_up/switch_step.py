"""The step that presses every foot switch by hand, and finds its bit in the board's packet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .session import Outcome, Request, Session

POLLS = 20000


def check_switches(session: Session) -> Outcome:
    """Press one switch after the other; writes the order of ``board.switches``."""
    outcome = Outcome()
    order = list(session.hardware.board.switches)
    count = len(order)
    session.do(Request("press", "", "hang the robot up, so that nothing touches its soles"))
    rest = _closed(session, count)
    if rest is None:
        outcome.add("board.port", "packets of the sensor board", "none", "check the board's supply")
        return outcome
    bits: dict[str, int] = {}
    for point in order:
        session.do(Request("press", point, f"press {point}, and hold it until you confirm"))
        pressed = _closed(session, count)
        if pressed is None:
            outcome.add("board.port", "packets", "none any more", "check the board's cable")
            return outcome
        changed = np.flatnonzero(pressed != rest).tolist()
        place = f"board.switches: {point}"
        if len(changed) != 1:
            found = "no change" if not changed else f"bits {changed} change"
            stuck = " (a switch is closed at rest)" if rest.any() and not changed else ""
            outcome.add(
                place, "one bit that changes", found + stuck,
                "the switch or its cable is broken or stuck: repair it, and press one at a time",
            )  # fmt: skip
            continue
        bit = int(changed[0])
        if rest[bit]:
            outcome.add(
                place, "closed when pressed", "open when pressed",
                "its polarity is inverted: wire it as a normally open switch, or set the board's firmware",
            )  # fmt: skip
        bits[point] = bit
    outcome.values["bits"] = bits
    if outcome.findings:
        return outcome
    if len(set(bits.values())) != count:
        outcome.add(
            "board.switches", "a bit for each switch", f"{bits}", "two switches share a cable"
        )
        return outcome
    sorted_points = sorted(order, key=lambda point: bits[point])
    if sorted_points != order:
        outcome.add("board.switches", f"{order}", f"{sorted_points}", "written", mended=True)
        session.write({}, {"switches": sorted_points})
    return outcome


def _closed(session: Session, count: int) -> NDArray[np.bool_] | None:
    """The switches' bits of a packet from now on; ``None`` if none comes."""
    session.board.poll()
    for _ in range(POLLS):
        if session.board.poll():
            return session.board.closed[:count].copy()
    return None
