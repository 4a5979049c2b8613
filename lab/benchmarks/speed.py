"""What a person waits for, as ratios to an earlier build: processor time of processes that take turns.

Every row is measured in both builds by turns, so whatever else the machine does hits them alike. Its interval
goes from the least to the largest ratio of a pair: of five pairs it contains the median with 94 %. A row whose whole
interval lies above ``REGRESSION`` fails.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from .earlier_build import ROOT, Build, builds_beside
from .rows import Row

REGRESSION = 1.05
"""The ratio that noise may reach."""
PAIRS, LONG_PAIRS = 5, 3
TIMEOUT = 900.0
JUMP = "aloft/graphs/jump.yaml"
GROWTH_GOAL, WHOLE_GOAL = 1.3, 1.5
"""Largest good growth of a block's start from 100 to 4,900 blocks, and time of a jump's ticks as a multiple of MuJoCo's alone."""

CHAIN = """
import json, time
import aloft

def chain(count):
    lines = ["rate: 100 Hz", "blocks:", "  g0: {use: blocks.SineWave, with: {amplitude: 1.0}}"]
    lines += [f"  g{k}: {{use: blocks.Gain, with: {{gain: 1.01}}, in: {{u: g{k - 1}.y}}}}" for k in range(1, count + 1)]
    return "\\n".join(lines) + "\\n"
"""
"""Defines the file of a graph of so many blocks in a row."""
CHAINS = (
    CHAIN
    + """
def measure(count):
    begin = time.process_time()
    graph = aloft.load(chain(count))
    loaded = time.process_time()
    with graph.open():
        return loaded - begin, time.process_time() - loaded

measure(10)
few = min(measure(100)[1] for _ in range(5))
load, start = measure(4900)
print(json.dumps({"load": load, "start": start, "growth": start / 4900 / (few / 100)}))
"""
)
"""Loads and starts chains of blocks; prints the processor times [s] and the growth of a block's."""


NEW_TASKS = """
import json
from aloft.planner.solving.solve import solve_jump
from aloft.planner.solving.solver_process import cpu_time
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot

robot = find_robot("bruce")

def measure(**wanted):
    task = make_task({"name": "new", "robot": "bruce", "rise": 0.11, **wanted})
    begin = cpu_time()
    solve_jump(task, robot)
    return cpu_time() - begin

def least(**wanted):  # the first one derives functions and makes the solver
    return min(measure(**wanted) for _ in range(4))

print(json.dumps({"sagittal": least(distance_x=0.1), "full": least(distance_x=0.1, twist=0.3)}))
"""
"""Plans new tasks without a plan of a near one; prints the processor times [s]."""


@dataclass(frozen=True)
class Case:
    """A process that is measured.

    Attributes:
        arguments: those of Python.
        figures: the rows' names, and which figure of the process each is: ``time`` [s of processors, children
            included], ``memory`` [MB, the largest], or a key of the JSON object that it prints last.
        codes: the exit codes that are right.
        long: whether it takes more than 5 s, so it is measured only with ``--all``.
        forgets: folders of the cache that are emptied before.
    """

    arguments: Sequence[str]
    figures: Mapping[str, str]
    codes: Sequence[int] = (0,)
    long: bool = False
    forgets: Sequence[str] = ()


def _aloft(*arguments: str) -> tuple[str, ...]:
    return ("-m", "aloft", *arguments)


PLANS = ("planner", "plans", "checked")
CASES = (
    Case(_aloft("--help"), {"aloft --help": "time"}),
    Case(_aloft("--version"), {"aloft --version": "time"}),
    Case(_aloft("check", JUMP), {"aloft check graphs/jump.yaml": "time"}),
    Case(
        _aloft("run", JUMP, "--no-record", "--json"),
        {"aloft run graphs/jump.yaml, unrecorded": "time", "its largest memory": "memory"},
    ),
    Case(
        _aloft("run", JUMP, "--record", "jump.rrd", "--json"),
        {"aloft run graphs/jump.yaml, recorded": "time"},
    ),
    Case(
        ("-c", CHAINS),
        {"4,900 blocks load": "load", "4,900 blocks bind and start": "start", "growth of a block's start, 100 to 4,900 blocks": "growth"},
    ),
    Case(
        _aloft("jump", "--rise", "11cm", "--no-record", "--json"),
        {"jump of a new height, planned and run": "time"}, forgets=("plans", "checked"),
    ),
    Case(
        _aloft("bench", "online_plans", "--count", "40", "--json"),
        {
            name: name
            for kind in ("straight", "all coordinates")
            for name in (f"plan in the loop, {kind}, median", f"plan in the loop, {kind}, 99 %")
        },
        codes=(0, 1), long=True,
    ),
    Case(
        ("-c", NEW_TASKS),
        {"plan of a new task, sagittal": "sagittal", "plan of a new task, all coordinates": "full"}, long=True,
    ),
    Case(
        _aloft("jump", "--robot", "ROBOT", "--rise", "10cm", "--no-record", "--json"),
        {"first jump of a URDF, 10 cm up": "time"}, long=True, forgets=PLANS,
    ),
    Case(
        _aloft("jump", "--robot", "ROBOT", "--forward", "25cm", "--turn", "20deg", "--no-record", "--json"),
        {"first jump of a URDF, 25 cm ahead, turned 20 deg": "time"}, long=True, forgets=PLANS,
    ),
)  # fmt: skip
ROBOT = "share/example-robot-data/robots/laikago_description/urdf/laikago.urdf"
"""The robot of the first jumps, in the package ``example-robot-data``."""

FIRST_RUN = """
import aloft
graph = aloft.load('''
rate: 100 Hz
duration: 1 s
blocks:
  one: {use: blocks.SineWave, with: {amplitude: 1.0}}
  sum: {use: blocks.Integrator, in: {u: one.y}}
''')
assert graph.run().success
"""
PEERS = {
    "drake": (
        "pydrake",
        """
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Integrator, Sine
builder = DiagramBuilder()
one, total = builder.AddSystem(Sine(1.0, 1.0, 0.0, 1)), builder.AddSystem(Integrator(1))
builder.Connect(one.get_output_port(0), total.get_input_port())
Simulator(builder.Build()).AdvanceTo(1.0)
""",
    ),
    "mink": (
        "mink",
        """
import mink, mujoco, numpy
model = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><body><joint axis="0 1 0"/><geom size="0.1"/></body></worldbody></mujoco>')
configuration = mink.Configuration(model)
for _ in range(100):
    configuration.integrate_inplace(numpy.zeros(model.nv), 0.01)
""",
    ),
    "upkie": ("upkie", "import upkie.envs; upkie.envs.register()"),
}
"""By name the module and a first run of other frameworks: import, two blocks or one joint, one second."""


@dataclass(frozen=True)
class PairedRow(Row):
    """A row whose ratio to the earlier build has the interval from ``ratio_p10`` to ``ratio_p90``."""

    @property
    def met(self) -> bool | None:
        """True unless the whole interval lies above ``REGRESSION``."""
        return None if self.ratio_p10 is None else self.ratio_p10 <= REGRESSION


def speed(since: str = "", everything: bool = False) -> list[Row]:
    """Measure what a person waits for.

    Args:
        since: the earlier build, a folder or a commit; without it there are no ratios.
        everything: whether the long rows are measured as well, each three times.

    Raises:
        AloftError: there is no such build.
        AssertionError: a process failed.
    """
    with builds_beside(since) as builds:
        rows: list[Row] = []
        for case in CASES:
            if everything or not case.long:
                rows += _rows(case, builds, since)
        return [*rows, *mujoco_alone(), *_first_runs(builds[0])]


def _rows(case: Case, builds: Sequence[Build], since: str) -> list[Row]:
    arguments = list(case.arguments)
    if "ROBOT" in arguments:
        robot = next((place for each in sys.path if (place := Path(each) / "cmeel.prefix" / ROBOT).is_file()), None)  # fmt: skip
        if robot is None:
            note = "not measured: pip install example-robot-data"
            return [Row(name, None, "s", note=note) for name in case.figures]
        arguments[arguments.index("ROBOT")] = str(robot)
    found: list[list[dict[str, float]]] = [[] for _ in builds]
    for turn in range(-1, LONG_PAIRS if case.long else PAIRS):  # the first one fills the caches
        for k in sorted(range(len(builds)), reverse=turn % 2 == 1):
            figures = run_process(arguments, builds[k], case.codes, case.forgets)
            if turn >= 0:
                found[k].append(figures)
    return [
        paired(name, [[each[key] for each in of_build] for of_build in found], _unit(key), since)
        for name, key in case.figures.items()
    ]


def _unit(figure: str) -> str:
    return {"memory": "MB", "growth": "1"}.get(figure, "s")


def paired(name: str, found: Sequence[Sequence[float]], unit: str, since: str) -> Row:
    """Return the row of figures of this build and of the earlier one, if there is one, in the order of their turns."""
    own = float(np.median(found[0]))
    goal = GROWTH_GOAL if unit == "1" else None
    if len(found) == 1:
        return Row(name, own, unit, goal=goal)
    ratios = np.array(found[0]) / np.array(found[1])
    least, middle, largest = (float(np.percentile(ratios, share)) for share in (0, 50, 100))
    return PairedRow(
        name, own, unit, since, middle, REGRESSION, least, largest,
        f"{len(ratios)} pairs, ratio {least:.2f} to {largest:.2f}",
    )  # fmt: skip


_WITNESS = """
import json, os, sys
pid = os.posix_spawn(sys.executable, [sys.executable, *sys.argv[2:]], os.environ)
_, status, used = os.wait4(pid, 0)
with open(sys.argv[1], "w") as file:
    json.dump([os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, used.ru_maxrss], file)
"""
"""Starts the process that is measured: Linux counts the memory of whoever starts a process as its peak, so that must be small."""


def run_process(
    arguments: Sequence[str], build: Build, codes: Sequence[int] = (0,), forgets: Sequence[str] = ()
) -> dict[str, float]:
    """Run Python with a build; return the figures of the process, see ``Case``.

    Raises:
        AssertionError: it ended with another exit code.
    """
    cache = build.folder / "cache"
    for name in forgets:
        shutil.rmtree(cache / "aloft" / name, ignore_errors=True)
    with (
        tempfile.TemporaryFile() as output,
        tempfile.TemporaryFile() as errors,
        tempfile.NamedTemporaryFile() as usage,
    ):
        process = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _WITNESS, usage.name, *arguments], cwd=build.folder,
            stdout=output, stderr=errors, env=build.environment(XDG_CACHE_HOME=str(cache)),
            start_new_session=True,
        )  # fmt: skip
        try:
            process.wait(TIMEOUT)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            raise AssertionError(
                f"{' '.join(arguments)[:80]} did not end in {TIMEOUT:.0f} s"
            ) from None
        for file in (output, errors):
            file.seek(0)
        text, problem = output.read().decode(), errors.read().decode(errors="replace")
        code, seconds, kilobytes = json.loads(usage.read())
    if code not in codes:
        raise AssertionError(f"{' '.join(arguments)[:80]} ended with {code}: {problem[-500:]}")
    figures = {"time": seconds, "memory": kilobytes / 1024.0}
    try:
        printed = json.loads(text.strip().splitlines()[-1])
    except (IndexError, ValueError):
        printed = {}
    if isinstance(rows := printed.get("rows"), list):  # of another benchmark
        printed = {row["name"]: row["value"] for row in rows}
    return figures | {k: v for k, v in printed.items() if isinstance(v, float)}


def mujoco_alone(rounds: int = PAIRS) -> list[Row]:
    """Compare the ticks of a jump with MuJoCo's steps alone, which get the same torques, state by state: with the
    model's own integrator throughout, and as the jump's steps are made, by Runge and Kutta's method where nothing touches the ground."""
    import mujoco

    from ... import load

    with load(ROOT / "graphs" / "jump.yaml").open() as run:
        plant = run._bound.blocks["robot"].plant  # type: ignore[attr-defined]
        model, data = plant.model, plant.data
        ticks = 1400
        torques = np.zeros((ticks, model.nu))
        places, rates = np.zeros((ticks, model.nq)), np.zeros((ticks, model.nv))
        flies = np.zeros(ticks, bool)
        for k in range(ticks):
            places[k], rates[k], flies[k] = data.qpos, data.qvel, data.ncon == 0
            run.step(1)
            torques[k] = data.ctrl
        steps = round(1.0 / (run.graph.base_rate * model.opt.timestep))
        airborne = copy(model)
        airborne.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        airborne.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        models = {
            "same torques": [model] * ticks,
            "same torques and integrators": [airborne if each else model for each in flies],
        }
        alone = mujoco.MjData(model)
        whole, bare = np.zeros(rounds), {peer: np.zeros(rounds) for peer in models}
        for turn in range(rounds):
            run.reset()
            begin = time.process_time()
            run.step(ticks)
            whole[turn] = time.process_time() - begin
            for peer, used in models.items():
                begin = time.process_time()
                for k in range(ticks):
                    alone.qpos, alone.qvel, alone.ctrl = places[k], rates[k], torques[k]
                    mujoco.mj_step(used[k], alone, steps)
                bare[peer][turn] = time.process_time() - begin
    rows = []
    for peer, times in bare.items():
        least, median, largest = (float(np.percentile(whole / times, q)) for q in (0, 50, 100))
        rows.append(
            Row("a jump's ticks with the whole stack", float(np.median(whole)), "s", f"MuJoCo alone, {peer}",
                median, WHOLE_GOAL, least, largest,
                f"{ticks} ticks of {steps} steps, {flies.sum()} of them in flight, ratio {least:.2f} to {largest:.2f}")
        )  # fmt: skip
    return rows


def _first_runs(build: Build) -> list[Row]:
    """Compare import and first run with those of other frameworks, where they are installed."""
    name = "import and first run of two blocks"
    rows = []
    for peer, (module, code) in PEERS.items():
        if find_spec(module) is None:
            rows.append(Row(name, None, "s", peer, note=f"{peer} is not installed"))
            continue
        found = [
            [run_process(("-c", each), build)["time"] for each in (FIRST_RUN, code)]
            for _ in range(PAIRS + 1)
        ][1:]
        own, other = np.transpose(found)
        ratios = own / other
        rows.append(
            Row(name, float(np.median(own)), "s", peer, float(np.median(ratios)),
                ratio_p10=float(ratios.min()), ratio_p90=float(ratios.max()),
                note=f"ratio {ratios.min():.2f} to {ratios.max():.2f}")
        )  # fmt: skip
    return rows
