"""The rows of the tick's benchmark: what is compared with what, with its floor and its goal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...runtime.running.timing import block_times
from ..rows import Row, compare
from .controller import RecordedController
from .tsid import INSTALL
from .tsid_check import TORQUE_ERROR, TsidCheck

PLAIN = "controller, plain Python"
COMPILED = "controller, kernels one by one"
FUSED = "controller, fused"
OSQP = "controller, kernels one by one, whole-body program by OSQP"
TSID = "controller, kernels one by one, whole-body controller in TSID"
BARE = "controller, no times, checks or record"
HAND = "hand-written loop of the same bodies"
QP, QP_OSQP, QP_DAQP = "whole-body program", "the same by OSQP", "the same by DAQP"
WHOLE_BODY = "state to torque"
WHOLE_BODY_OSQP = "state to torque, OSQP"
WHOLE_BODY_TSID = "state to torque, TSID"
STATE_TO_TORQUE = ("dynamics", "wbc")
"""The blocks from the estimated state to torques."""

Times = dict[str, NDArray[np.float64]]


def block_rows(controller: RecordedController, prefix: str) -> list[Row]:
    """The median time of every block, in the order in which they run."""
    programs = controller.ticker.programs
    for program in programs:
        program.fold()
    order = controller.bound.graph.order
    return [Row(f"{prefix}{p}", block_times(programs, p).p50_us, "us/tick") for p in order]


def controller_rows(times: Times, of_first: Times, missing: str) -> list[Row]:
    rows = [
        compare(PLAIN, of_first, COMPILED),
        Row(COMPILED, float(np.median(times[COMPILED])), "us/tick"),
        compare(FUSED, times, COMPILED),
        Row(HAND, float(np.median(times[HAND])), "us/tick"),
        compare(BARE, times, HAND, floor=1.05, goal=1.02, note="the scheduler's share"),
    ]
    if missing:
        return [*rows, Row(OSQP, None, "us/tick", COMPILED, note=missing)]
    limits = {COMPILED: (1 / 8, 1 / 12), FUSED: (1 / 20, 1 / 30)}
    return [
        *rows,
        Row(OSQP, float(np.median(times[OSQP])), "us/tick"),
        *(
            compare(
                f"{name}, beside OSQP",
                {**times, f"{name}, beside OSQP": times[name]},
                OSQP,
                floor=floor,
                goal=goal,
            )
            for name, (floor, goal) in limits.items()
        ),
    ]


def program_rows(times: Times, missing: str) -> list[Row]:
    """From model terms to accelerations, forces and torques."""
    if QP not in times:
        return []
    rows = [compare(f"{QP}, beside DAQP", {**times, f"{QP}, beside DAQP": times[QP]}, QP_DAQP,
                    floor=1 / 1.8, goal=1 / 2.5, note="DAQP without its assembly, from its own answer")]  # fmt: skip
    rows.append(Row(QP_DAQP, float(np.median(times[QP_DAQP])), "us/tick"))
    if missing:
        return [*rows, Row(QP_OSQP, None, "us/tick", QP, note=missing)]
    name = f"{QP}, beside OSQP"
    return [
        *rows,
        compare(
            name,
            {**times, name: times[QP]},
            QP_OSQP,
            floor=1 / 25,
            goal=1 / 40,
            note="OSQP at 1e-3 as in BRUCE's code, without its assembly, from its own answer",
        ),
        Row(QP_OSQP, float(np.median(times[QP_OSQP])), "us/tick"),
    ]


def state_to_torque_rows(
    own: RecordedController, osqp: RecordedController | None, missing: str
) -> list[Row]:
    """The dynamics and the whole-body controller, tasks included."""
    value = _sum_of(own)
    if osqp is None:
        return [Row(WHOLE_BODY, value, "us/tick", WHOLE_BODY_OSQP, note=missing)]
    other = _sum_of(osqp)
    return [
        Row(
            WHOLE_BODY,
            value,
            "us/tick",
            WHOLE_BODY_OSQP,
            value / other,
            1 / 55,
            floor=1 / 30,
            note="dynamics compiled in both",
        ),
        Row(WHOLE_BODY_OSQP, other, "us/tick"),
    ]


def _sum_of(controller: RecordedController, paths: Sequence[str] = STATE_TO_TORQUE) -> float:
    programs = controller.ticker.programs
    for program in programs:
        program.fold()
    return sum(block_times(programs, path).p50_us for path in paths)


def tsid_rows(
    times: Times,
    fused: RecordedController,
    tsid: RecordedController | None,
    check: TsidCheck | None,
) -> list[Row]:
    """Beside TSID, which computes the terms of the dynamics by itself."""
    value = _sum_of(fused)
    if tsid is None or check is None:
        note = f"not installed; {INSTALL}; aloft bench tick --tsid FOLDER"
        return [Row(WHOLE_BODY_TSID, None, "us/tick", WHOLE_BODY, note=note)]
    other = _sum_of(tsid, ("wbc",))
    agreed = (
        f"torques agree to {max(check.errors):.1g} N m (limit {TORQUE_ERROR:g}) in the "
        f"{len(check.errors)} states that were compared"
    )
    limits = {COMPILED: (1 / 1.5, 1 / 2), FUSED: (1 / 4, 1 / 5)}
    return [
        Row(f"{WHOLE_BODY}, beside TSID", value, "us/tick", WHOLE_BODY_TSID, value / other, 1 / 6,
            floor=1 / 4, note="TSID with its own dynamics; fused"),
        Row(WHOLE_BODY_TSID, other, "us/tick", note=agreed),
        Row(TSID, float(np.median(times[TSID])), "us/tick"),
        *(
            compare(f"{name}, beside TSID", {**times, f"{name}, beside TSID": times[name]}, TSID,
                    floor=floor, goal=goal)
            for name, (floor, goal) in limits.items()
        ),
    ]  # fmt: skip


def earlier_rows(times: Times, before: Sequence[Mapping[str, float]], commit: str) -> list[Row]:
    """Beside the controller of an earlier commit, which ran once for every round; its tick is the sum of
    its blocks' medians, so without its scheduler and its recording."""
    if not before:
        return [Row("controller of an earlier commit", None, "us/tick", COMPILED,
                    note="not measured; aloft bench tick --since COMMIT, in a clone")]  # fmt: skip
    name = f"controller as of {commit}, its blocks only"
    sums = np.array([sum(one.values()) for one in before])
    rows = [
        Row(f"old block {path}", float(np.median([one[path] for one in before])), "us/tick")
        for path in before[0]
    ]
    rows.append(Row(name, float(np.median(sums)), "us/tick"))
    for own, floor, goal in ((COMPILED, 1 / 12, 1 / 20), (FUSED, 1 / 30, 1 / 45)):
        ticks = np.median(times[own].reshape(len(sums), -1), axis=1)
        rows.append(
            compare(f"{own}, beside {commit}", {f"{own}, beside {commit}": ticks, name: sums}, name,
                    floor=floor, goal=goal)
        )  # fmt: skip
    return rows
