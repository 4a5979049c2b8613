"""One tick of the controller of a jump: block by block, whole, and beside other solvers.

All cases run the same recorded jump of ``graphs/jump.yaml`` in turns of ``CHUNK`` ticks, so whatever
else the machine does hits them alike. A ratio is the median over the ratios of single ticks.
The process of a jump as a whole and a loop that waits busily are measured in real time. ``--since``
measures the controller as it was at an earlier commit, in the same run.
"""

from __future__ import annotations

import gc
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from ....blocks.control.dynamics import Dynamics
from ....blocks.control.whole_body_controller import WholeBodyController
from ....files.pip_line import pip_line
from ..earlier_build import Build
from ..full_program import FullMatrices
from ..rows import Row
from ..startup import time_process
from .controller import (
    GRAPH,
    OUTSIDE,
    HandWrittenLoop,
    RecordedController,
    RecordedJump,
    record_jump,
)
from .programs import (  # fmt: skip
    BARE,
    COMPILED,
    FUSED,
    HAND,
    OSQP,
    PLAIN,
    QP,
    QP_DAQP,
    QP_OSQP,
    TSID,
    DaqpProgram,
    OsqpController,
    OsqpProgram,
    PeerProgram,
    Times,
    block_rows,
    controller_rows,
    earlier_rows,
    program_rows,
    state_to_torque_rows,
    tsid_rows,
)
from .tsid import TsidCheck, TsidController, TsidProgram, import_tsid

RATES = (500, 1000, 2000, 4000, 5000, 8000, 10_000, 15_000, 20_000)
"""The rates that the loop tries [Hz]."""
LATE = 0.005
"""The share of ticks that may be late."""
SECONDS = 1.0


def process_row(jump: RecordedJump, repeats: int = 3) -> Row:
    """Measure the shortest of a few whole processes of ``aloft run graphs/jump.yaml``, with its
    recording, as a share of the time that the jump takes in the world."""
    with tempfile.TemporaryDirectory() as folder:
        found = time_process(["run", str(GRAPH), "--json"], Path(folder), repeats)
    lasted = json.loads(found.output)["ticks"] * jump.graph.base_period
    wall = found.wall
    return Row(
        "aloft run graphs/jump.yaml, whole process", wall, "s", "real time", wall / lasted,
        goal=1 / 5, floor=1 / 2, note=f"with its recording; the jump takes {lasted:.2f} s, "
        f"the processors {found.user:.2f} s",
    )  # fmt: skip


def busy_wait_row(jump: RecordedJump, seconds: float = SECONDS) -> Row:
    """Find the shortest period at which fewer than ``LATE`` of the ticks begin late."""
    controller = RecordedController(jump)
    controller.run(min(jump.ticks, 200))
    best, shares = 0, []
    for rate in RATES:
        share = late_share(controller, jump, rate, seconds)
        shares.append(f"{rate / 1000:g} kHz {100 * share:.1f} %")
        if share < LATE:
            best = rate
    if not best:
        return Row("busy-wait loop, period", None, "us", note=f"late: {', '.join(shares)}")
    return Row(
        "busy-wait loop, period", 1e6 / best, "us", goal=50.0, floor=250.0,
        note=f"{best / 1000:g} kHz; late: {', '.join(shares)}",
    )  # fmt: skip


def late_share(
    controller: RecordedController, jump: RecordedJump, rate: float, seconds: float
) -> float:
    """Measure the share of ticks whose deadline had passed before they could begin. A tick that is
    late begins at once, and the deadlines after it are counted from there."""
    advance, now = controller.ticker.advance, time.perf_counter_ns
    period, count = round(1e9 / rate), max(1, round(seconds * rate))
    late = 0
    deadline = now() + period
    for _ in range(count):
        if controller.tick == jump.ticks:
            controller.again()  # where the jump begins anew, the time for that is given
            deadline = now() + period
        if now() > deadline:
            late += 1
            deadline = now()
        while now() < deadline:
            pass
        controller.show(controller.tick)
        advance(1)
        controller.bound.clock.stop_reason = None
        deadline += period
    return late / count


class EarlierController:
    """The sources of a commit, in a temporary folder, and runs of their ``jump.yaml``.

    Args:
        commit: any name that git knows.

    Raises:
        AloftError: these sources are no git repository, or it has no such commit.
    """

    def __init__(self, commit: str) -> None:
        self.commit, self._build = commit, Build(commit)

    def run(self) -> dict[str, float]:
        """Run its jump once, in a process of its own; returns the median time of every block of the
        controller [us], which contains neither the scheduler nor the recording.

        Raises:
            AssertionError: the run failed.
        """
        folder = self._build.folder
        done = subprocess.run(
            [sys.executable, "-m", "aloft", "run", "aloft/graphs/jump.yaml", "--json"],
            check=False, cwd=folder, capture_output=True, text=True, timeout=600,
            env=self._build.environment(),
        )  # fmt: skip
        if done.returncode:
            raise AssertionError(f"the jump of {self.commit} failed: {done.stderr[-500:]}")
        blocks = json.loads(done.stdout)["blocks"]
        return {path: b["p50_us"] for path, b in blocks.items() if path not in OUTSIDE}

    def close(self) -> None:
        """Remove the sources."""
        self._build.close()


CHUNK = 50
PLAIN_TICKS = 200
"""Number of ticks in which plain Python takes part: it needs tens of milliseconds for each."""
EVERY = 10
"""One in so many ticks in stance is a state for the solvers by themselves."""
ROUNDS = 5
"""Turns of the solvers in each of these states, of which the median counts."""
TORQUE_ERROR = 1e-6
"""Largest accepted difference between the torques of two exact methods [N m]."""


def tick(
    rounds: int = 3,
    ticks: int | None = None,
    process: bool = True,
    tsid: str = "",
    since: str = "",
) -> list[Row]:
    """Measure and return the rows.

    Args:
        rounds: how often the jump is run again; plain Python takes part in the first ticks of the first round only.
        ticks: how much of the jump is used; by default all.
        process: whether the whole process and the loop in real time are measured as well.
        tsid: a folder with the wheels of TSID, which is a peer then (``tick_tsid``).
        since: a commit whose controller is a peer as well (``tick_since``).

    Raises:
        AloftError: TSID or the commit is not there.
        AssertionError: the controller computes something else than in the recorded jump, or the
            methods that are exact do not agree.
    """
    module = import_tsid(Path(tsid)) if tsid else None  # before anything imports Pinocchio
    earlier = EarlierController(since) if since else None
    jump = record_jump(ticks)
    own, plain = RecordedController(jump, fuse=False), RecordedController(jump, plain=True)
    fused = RecordedController(jump)
    bare = RecordedController(jump, fuse=False, timing=False, checks=False, record=False)
    cases = {COMPILED: own, FUSED: fused, BARE: bare, HAND: HandWrittenLoop(jump)}
    missing = _missing("osqp")
    programs = _programs(own, with_osqp=not missing)
    if not missing:
        cases[OSQP] = _osqp_controller(jump)
    check = None
    if module is not None:
        cases[TSID], check = _tsid_controller(jump, module), TsidCheck(module, fused)
    for case in cases.values():  # warm, and what OSQP must know beforehand
        shown = check.compare if check is not None and case is fused else None
        case.run(jump.ticks, programs.learn if case is own else shown)
    before: list[dict[str, float]] = []
    with _quiet():
        for number in range(rounds):
            running = {PLAIN: plain, **cases} if number == 0 else cases
            _one_round(jump, running, programs if number == 0 else None)
            if earlier is not None:
                before.append(earlier.run())
    if earlier is not None:
        earlier.close()
    times = {name: np.array(case.times[-rounds * jump.ticks :]) for name, case in cases.items()}
    of_first = {PLAIN: np.array(plain.times), COMPILED: times[COMPILED][: len(plain.times)]}
    rows = [
        *block_rows(own, "block "),
        *block_rows(fused, "fused block "),
        *(block_rows(cases[OSQP], "OSQP block ") if OSQP in cases else []),
        *(block_rows(cases[TSID], "TSID block ") if TSID in cases else []),
        *controller_rows(times, of_first, missing),
    ]
    rows += program_rows(programs.times, missing)
    rows += state_to_torque_rows(fused, cases.get(OSQP), missing)
    rows += tsid_rows(times, fused, cases.get(TSID), check)
    rows += earlier_rows(times, before, since)
    if process:
        rows += [process_row(jump), busy_wait_row(jump)]
    return rows


def _one_round(
    jump: RecordedJump, cases: Mapping[str, RecordedController], programs: _Programs | None
) -> None:
    """Run the jump once, all cases in turns; the order shifts from turn to turn."""
    for case in cases.values():
        case.again()
    names = list(cases)
    for turn in range(-(-jump.ticks // CHUNK)):
        shift = turn % len(names)
        for name in (*names[shift:], *names[:shift]):
            if name != PLAIN or cases[name].tick < PLAIN_TICKS:
                cases[name].run(CHUNK)
    for name in (PLAIN, COMPILED, FUSED, BARE, HAND):
        if name in cases:
            cases[name].check()
    if programs is not None:
        cases[COMPILED].again()
        cases[COMPILED].run(jump.ticks, programs.measure)


class _Programs:
    """The whole-body program of one controller's present state, solved in several ways."""

    def __init__(self, block: WholeBodyController, *, with_osqp: bool) -> None:
        self._block = block
        self._acceleration = np.zeros_like(block.command.acceleration)
        self._force = np.zeros_like(block.command.force)
        self._torque = np.zeros(block.command.torque.shape[0])
        self._daqp = DaqpProgram(block)
        self._osqp = OsqpProgram(block) if with_osqp else None
        self.times: Times = {}
        self._found: list[dict[str, float]] = []

    def _own(self) -> None:
        self._block._reduce.run()
        self._block._solve.run()

    def learn(self, tick: int) -> None:
        """Show a state to OSQP."""
        active = np.flatnonzero(self._block.phase.stance)
        if self._osqp is not None and active.size:
            self._osqp.learn(active)

    def measure(self, tick: int) -> None:
        """Solve the program of the present state in all ways, in turns."""
        active = np.flatnonzero(self._block.phase.stance)
        if tick % EVERY or not active.size:
            return
        prepared = self._daqp.assemble(active)
        cases: dict[str, Callable[[], object]] = {
            QP: self._own,
            QP_DAQP: lambda: self._solve(self._daqp, active, prepared),
        }
        if self._osqp is not None:
            osqp = self._osqp
            ready = osqp.assemble(active)
            cases[QP_OSQP] = lambda: self._solve(osqp, active, ready)
        taken: dict[str, list[float]] = {name: [] for name in cases}
        for _ in range(ROUNDS):
            for name, body in cases.items():
                taken[name].append(_hot(body))
        self._found.append({name: float(np.median(found)) for name, found in taken.items()})
        self.times = {name: np.array([each[name] for each in self._found]) for name in cases}
        self._solve(self._daqp, active, prepared)
        apart = float(np.abs(self._torque - self._block.command.torque).max())
        if self._block.command.solved and apart > TORQUE_ERROR:
            raise AssertionError(f"tick {tick}: DAQP's torque is {apart:.2g} N m from the own one")

    def _solve(self, peer: PeerProgram, active: NDArray[np.int64], program: FullMatrices) -> None:
        """Solve the program whose matrices are ready for accelerations, forces and torques."""
        answer, n = peer.solve_assembled(program, len(active)), self._acceleration.shape[0]
        if answer is not None:
            self._acceleration[...] = answer[:n]
            self._force.fill(0.0)
            self._force[active] = answer[n:].reshape(-1, 3)
            self._torque[...] = peer.torque(answer, active)


def _programs(own: RecordedController, *, with_osqp: bool) -> _Programs:
    block = own.bound.blocks["wbc"]
    assert isinstance(block, WholeBodyController)
    return _Programs(block, with_osqp=with_osqp)


def _osqp_controller(jump: RecordedJump) -> RecordedController:
    """Return the controller with OSQP, which has seen every state of the jump once."""
    controller = RecordedController(jump, fuse=False, instead={"wbc": OsqpController})
    controller.run(jump.ticks)
    block = controller.bound.blocks["wbc"]
    assert isinstance(block, OsqpController)
    block.learning = False
    controller.again()
    return controller


def _tsid_controller(jump: RecordedJump, tsid: ModuleType) -> RecordedController:
    """Return the controller with TSID, whose model has the described mass."""
    controller = RecordedController(jump, fuse=False, instead={"wbc": TsidController})
    block, dynamics = controller.bound.blocks["wbc"], controller.bound.blocks["dynamics"]
    assert isinstance(block, TsidController) and isinstance(dynamics, Dynamics)
    block.use(TsidProgram(tsid, block, dynamics))
    return controller


def _hot(body: Callable[[], object]) -> float:
    """Measure the microseconds of a call that follows two others, as in a loop that does nothing
    else."""
    body()
    body()
    start = time.perf_counter_ns()
    body()
    return (time.perf_counter_ns() - start) * 1e-3


def _missing(package: str) -> str:
    """Return the reason why a peer cannot be measured; empty where it is installed."""
    from importlib.util import find_spec

    return "" if find_spec(package) else f"not installed: {pip_line('peers')} has {package}"


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Python from collecting garbage within."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()
