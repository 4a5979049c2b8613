"""The step that presses every foot switch by hand, and finds its bit in the board's packet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .session import Request, Session, StepReport

POLLS = 20000


def check_switches(session: Session) -> StepReport:
    """Press one switch after the other; writes ``board.switches`` and ``normally_closed``."""
    report = StepReport()
    order = list(session.hardware.board.switches)
    count = len(order)
    session.do(Request("press", "", "hang the robot up, so that nothing touches its soles"))
    rest = _closed(session, count)
    if rest is None:
        report.add("board.port", "packets of the sensor board", "none", "check the board's supply")
        return report
    bits: dict[str, int] = {}
    opens: list[str] = []
    for point in order:
        session.do(Request("press", point, f"press {point}, and hold it until you confirm"))
        pressed = _closed(session, count)
        if pressed is None:
            report.add("board.port", "packets", "none any more", "check the board's cable")
            return report
        changed = np.flatnonzero(pressed != rest).tolist()
        place = f"board.switches: {point}"
        if len(changed) != 1:
            found = "no change" if not changed else f"bits {changed} change"
            stuck = " (a switch is closed at rest)" if rest.any() and not changed else ""
            report.add(
                place, "one bit that changes", found + stuck,
                "the switch or its cable is broken or stuck: repair it, and press one at a time",
            )  # fmt: skip
            continue
        bit = int(changed[0])
        if rest[bit]:
            opens.append(point)
        bits[point] = bit
    report.values["bits"] = bits
    if report.discrepancies:
        return report
    if len(set(bits.values())) != count:
        report.add(
            "board.switches", "a bit for each switch", f"{bits}", "two switches share a cable"
        )
        return report
    sorted_points = sorted(order, key=lambda point: bits[point])
    before = session.hardware.board.normally_closed
    opens = [point for point in sorted_points if point in opens]
    if sorted_points != order:
        report.add("board.switches", f"{order}", f"{sorted_points}", "written", mended=True)
    if sorted(opens) != sorted(before):
        report.add(
            "board.normally_closed", f"{before}", f"{opens}: these open when pressed", "written",
            mended=True,
        )  # fmt: skip
    if report.discrepancies:
        session.write({}, {"switches": sorted_points, "normally_closed": opens})
    return report


def _closed(session: Session, count: int) -> NDArray[np.bool_] | None:
    """Return the switches' bits of a packet from now on; ``None`` if none comes."""
    session.board.poll()
    for _ in range(POLLS):
        if session.board.poll():
            return session.board.closed[:count].copy()
    return None
