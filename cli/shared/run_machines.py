"""Runs the parts of a graph that is spread over machines, for ``aloft run --machine`` and ``--local``.

``--machine NAME`` runs the part of one machine together with the others. ``--local`` starts such
a process for each machine here, with endpoints on the loopback. One table, one exit code and one recording come
out, as of a run in one process.
"""

from __future__ import annotations

import json
import signal
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...files.names import inside
from ...processes.child_process import ChildProcess
from ...runtime.language.errors import AloftError, ExitCode, RunError
from ...runtime.language.stages import CheckedGraph
from ...runtime.links.observer import StatusPublisher
from ...runtime.links.part import BoundPart, run_part
from ...runtime.links.path_ages import NAME
from ...runtime.live.part_feed import PartFeed
from ...runtime.loading import checked_file
from ...runtime.placement.placed import PlacedGraph, split_over_machines
from ...runtime.running.lateness import TickLateness
from ...runtime.running.real_time import NO_REAL_TIME, RealTimeOptions
from ...runtime.running.run_result import RunResult, merge_metrics
from ...runtime.running.sink import Sink
from ...runtime.running.timing import BlockTimes
from ...runtime.transports.registry import network_transport, transport_type
from .output import (
    number,
    table,
)
from .run_graph import KeptRecording, report_run
from .running_graphs import registered

if TYPE_CHECKING:
    from rich.console import Console

    from .plain_console import Table


GRACE = 15.0
"""Seconds that the other parts have to end after one has ended that does not end alone."""


@dataclass(frozen=True)
class RunOptions:
    """The options of a run: settings, the recording's path (by default that of a graph's) and
    whether it is kept, the name for ``aloft params``, the way of printing, whether nothing is
    compiled, the folder of keys, for links over TLS, and whether blocks of kernels are fused."""

    settings: Sequence[str]
    record: Path | None
    keep: bool
    params: str
    as_json: bool
    traceback: bool
    plain: bool
    keys: Path | None = None
    fuse: bool = True


def run_local(path: Path, options: RunOptions, out: Console) -> ExitCode:
    """Run all parts of the graph in ``path``; print one result.

    Raises:
        LoadError: the graph is wrong.
        PlacementError: it names no machines.
        AloftError: a part said nothing when it ended.
    """
    from ...logs.recording.merged_run import merge_recordings, path_metrics, read_parts, run_hash_of
    from ...logs.recording.output_file import cause_of, remedy

    placed = split_over_machines(checked_file(path, options.settings))
    graph = placed.graph
    with tempfile.TemporaryDirectory(prefix="aloft-parts-") as folder:
        files = {
            machine.name: inside(Path(folder), f"{machine.name}.rrd") for machine in placed.machines
        }
        part_reports = _run_processes(path, options, placed, files)
        parts = read_parts(placed, files) if all(f.exists() for f in files.values()) else {}
        run_hash, ticks = run_hash_of(placed, parts) if parts else ("", 0)
        ages = path_metrics(placed, parts) if parts else {}
        result = _whole_result(placed, part_reports, ages, run_hash, ticks)
        recording, problem = None, ""
        if options.keep:
            target = options.record or Path("recordings") / f"{graph.name}.rrd"
            problem = "; ".join(
                f"machine {name!r}: {part['recording_problem']}"
                for name, part in part_reports.items()
                if part.get("recording_problem")
            )
            try:
                if parts:
                    recording = merge_recordings(target, placed, parts, result.to_json())
            except OSError as error:
                why = error.strerror or error
                problem = f"no whole recording: {target} cannot be written ({why})"
                problem += f"; {remedy(cause_of(error), target)}"
    return report_run(
        out, graph, result, KeptRecording(recording, problem), as_json=options.as_json,
        traceback=options.traceback, tables=_link_tables(part_reports),
        warnings=result.warnings, last={"machines": part_reports},
    )  # fmt: skip


def _run_processes(
    path: Path, options: RunOptions, placed: PlacedGraph, files: Mapping[str, Path]
) -> dict[str, dict[str, Any]]:
    """Run the processes and return the report of each part at its end, by machine.

    Raises:
        AloftError: a part has said nothing.
    """
    endpoints = transport_type(placed.machines).local_endpoints(len(files), options.keys)
    settings = [
        f"machines.{name}={endpoint}" for name, endpoint in zip(files, endpoints, strict=True)
    ]
    settings = [*options.settings, *settings]
    sets = [text for setting in settings for text in ("--set", setting)]
    with ExitStack() as stack:
        stack.enter_context(registered(path, settings))
        running: dict[str, ChildProcess] = {}
        for number, (machine, file) in enumerate(files.items()):
            # the first part answers for the run, which one in real time does by the graph's name
            params = "none" if number else options.params
            arguments = [
                "run", str(path), *sets, "--machine", machine, "--record", str(file),
                "--params", params, "--json", "--quiet",
                *(["--plain"] if options.plain else []), *([] if options.fuse else ["--no-fuse"]),
                *(["--keys", str(options.keys)] if options.keys is not None else []),
            ]  # fmt: skip
            part = ChildProcess(
                f"the part on {machine!r}", f"{__name__}:main", arguments, stdout=True,
                parent_death=signal.SIGTERM,  # its blocks come to rest before it ends
            )  # fmt: skip
            running[machine] = stack.enter_context(part)
        free = placed.graph.links.mode == "free"
        alone = [name for name in running if free and not placed.sent_by(name)]
        outputs, received = _wait_for_all(running, alone)
        part_reports = {}
        for machine, part in running.items():
            try:
                part_reports[machine] = json.loads(outputs[machine].splitlines()[-1])
            except (IndexError, ValueError):
                if received:  # it had not come as far as a run
                    code, reason = ExitCode(128 + received[0]), f"stopped by {received[0].name}"
                    part_reports[machine] = {"exit_code": code, "reason": reason}
                    continue
                raise AloftError(
                    f"the part on {machine!r} ended with code {part.wait(GRACE)} and no result"
                ) from None
    return part_reports


def main(*arguments: str) -> None:
    """Run the command line with these arguments in the process of a part."""
    from .. import main as run_command_line

    sys.argv = ["aloft", *arguments]
    run_command_line()


def _wait_for_all(
    running: Mapping[str, ChildProcess],
    alone: Sequence[str] = (),
) -> tuple[dict[str, bytes], list[signal.Signals]]:
    """Wait until every process has ended; pass on SIGINT and SIGTERM, and end those that hang after
    the end of one that is not named in ``alone``.

    Returns what each has printed, and the signals that were passed on.
    """
    received: list[signal.Signals] = []

    def pass_on(number: int, _: object) -> None:
        received.append(signal.Signals(number))
        send(number)

    def send(number: int) -> None:
        for part in running.values():
            part.send_signal(number)

    before = {n: signal.signal(n, pass_on) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        with ThreadPoolExecutor(len(running)) as readers:
            outputs = {
                machine: readers.submit(part.stdout.read)
                for machine, part in running.items()
                if part.stdout is not None
            }
            ending = [output for machine, output in outputs.items() if machine not in alone]
            wait(ending, return_when=FIRST_COMPLETED)
            for number in (signal.SIGTERM, signal.SIGKILL):
                if wait(outputs.values(), timeout=GRACE if ending else None).not_done:
                    send(number)
        return {machine: output.result() for machine, output in outputs.items()}, received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _whole_result(
    placed: PlacedGraph,
    part_reports: Mapping[str, Mapping[str, Any]],
    ages: Mapping[str, Any],
    run_hash: str,
    ticks: int,
) -> RunResult:
    """Join the result of the whole run, from the reports of the parts, and from measured ages."""
    graph = placed.graph
    by_block = {
        path: found
        for spec in graph.blocks
        for path, found in part_reports[spec.machine].get("metrics_by_block", {}).items()
        if path == spec.path
    }
    measured = (part.get("metrics_by_block", {}).get(NAME) for part in part_reports.values())
    by_block[NAME] = next((found for found in measured if found), ages)
    metrics, unmet, success_text = merge_metrics(by_block)
    code, reason = _verdict(part_reports, unmet, success_text)
    failed = next(_culprits_first(part_reports), None)
    error = None
    if code is ExitCode.RUN_FAILED and failed is not None and part_reports[failed].get("error"):
        error = _error(part_reports[failed]["error"])
    return RunResult(
        success=code is ExitCode.SUCCESS,
        reason=reason,
        exit_code=code,
        ticks=ticks,
        period=graph.base_period,
        wall_time_s=max(
            (part.get("wall_time_s", 0.0) for part in part_reports.values()), default=0.0
        ),
        run_hash=run_hash,
        metrics=metrics,
        blocks=_times(graph, part_reports),
        overruns=sum(part.get("overruns", 0) for part in part_reports.values()),
        skipped_periods=sum(part.get("skipped_periods", 0) for part in part_reports.values()),
        lateness=TickLateness.merged(part.get("lateness") for part in part_reports.values()),
        error=error,
        stop_problems=_collected(part_reports, "stop_problems"),
        block_warnings=_collected(part_reports, "block_warnings"),
        warnings=tuple(
            f"{name}: {text}"
            for name, part in part_reports.items()
            for text in part.get("warnings", ())
            if text != part.get("recording_problem")
        ),
        graph=graph,
    )


def _culprits_first(part_reports: Mapping[str, Mapping[str, Any]]) -> Any:
    """Return the machines that failed: first those that failed by themselves, then those that were
    told."""
    failed = [name for name, part in part_reports.items() if part.get("exit_code", 3) == 3]
    return iter(sorted(failed, key=lambda name: bool(part_reports[name].get("heard"))))


def _verdict(
    part_reports: Mapping[str, Mapping[str, Any]], unmet: str | None, success_text: str | None
) -> tuple[ExitCode, str]:
    for name, part in part_reports.items():
        if "exit_code" not in part:  # it did not come as far as a run
            return ExitCode.BAD_INPUT, f"machine {name!r}: {part.get('reason', 'no result')}"
    for name in _culprits_first(part_reports):
        return ExitCode.RUN_FAILED, str(part_reports[name]["reason"])
    for part in part_reports.values():
        if part["exit_code"] >= ExitCode.INTERRUPTED:
            return ExitCode(part["exit_code"]), str(part["reason"])
    if unmet is not None:
        return ExitCode.NOT_SUCCESSFUL, unmet
    reasons = [str(part["reason"]) for part in part_reports.values()]
    return ExitCode.SUCCESS, success_text or reasons[0]


def _times(
    graph: CheckedGraph, part_reports: Mapping[str, Mapping[str, Any]]
) -> dict[str, BlockTimes]:
    """Return the times of every block on its own machine."""
    return {
        path: BlockTimes(**found)
        for path in graph.order
        if (found := part_reports[graph.block(path).machine].get("blocks", {}).get(path))
    }


def _collected(part_reports: Mapping[str, Mapping[str, Any]], key: str) -> tuple[str, ...]:
    return tuple(
        f"{name}: {text}" for name, part in part_reports.items() for text in part.get(key, ())
    )


def _error(data: Mapping[str, Any]) -> RunError:
    error = RunError(data["message"], block=data["block"], tick=data["tick"])
    error.where, error.traceback = data["where"], data["traceback"]
    return error


def _link_tables(part_reports: Mapping[str, Mapping[str, Any]]) -> list[Table]:
    """Make a table with one row for each link, if there are any."""
    links = [link for part in part_reports.values() for link in part.get("links", ())]
    if any("age_p50_ms" in link for link in links):
        columns: tuple[str, ...] = (
            "link", ">messages", ">lost", ">damaged", ">late ticks", ">median age [ms]",
            ">99 % [ms]", ">oldest [ms]", ">jitter [ms]",
        )  # fmt: skip
        keys: tuple[str, ...] = (
            "name", "received", "lost", "damaged", "late_ticks", "age_p50_ms", "age_p99_ms",
            "age_max_ms", "jitter_ms",
        )  # fmt: skip
    else:
        columns = ("link", ">messages", ">damaged", ">twice or late")
        keys = ("name", "received", "damaged", "surplus")
    rows = [tuple(number(link[key]) for key in keys) for link in links]
    return [table("links", columns, rows)] if rows else []


class MachineRun:
    """One machine's part, bound and ready to run once.

    Args:
        graph: the graph.
        machine: the machine.
        keys: the folder of ``aloft keys``, for links over TLS.

    Raises:
        PlacementError: the graph names no such machine.
        AloftError: endpoints and keys do not fit together.
        RunError: a block could not be set up.
    """

    def __init__(self, graph: CheckedGraph, machine: str, keys: Path | None = None) -> None:
        placed = split_over_machines(graph)
        self.bound = BoundPart(placed, machine, network_transport(placed, machine, keys))
        self._result: RunResult | None = None

    @property
    def checked(self) -> CheckedGraph:
        """The graph of this part."""
        return self.bound.graph

    def run(
        self,
        *,
        sinks: Sequence[Sink],
        log: bool,
        plain: bool = False,
        fuse: bool = True,
        real_time: RealTimeOptions = NO_REAL_TIME,
    ) -> RunResult:
        """Run the part once."""
        bound = self.bound
        showing = StatusPublisher(bound.machine, bound.transport, bound.peers, bound.receivers)
        feed = PartFeed(bound.machine, bound.transport)
        self._result = run_part(
            bound, sinks=[*sinks, showing, feed], log=log, plain=plain, fuse=fuse,
            real_time=real_time,
        )  # fmt: skip
        return self._result

    def about(self) -> Mapping[str, Any]:
        """Return the machine, the metrics of each of its blocks, the traffic of its links, and the
        others' clocks."""
        error = self._result.error if self._result is not None else None
        metrics = {path: dict(block.metrics()) for path, block in self.bound.blocks.items()}
        metrics |= {sink.name: dict(sink.metrics()) for sink in self.bound.path_ages}
        return {
            "machine": self.bound.machine,
            "heard": bool(getattr(error, "heard", False)),
            "metrics_by_block": {path: found for path, found in metrics.items() if found},
            "links": [receiver.about() for receiver in self.bound.receivers],
            "clocks": {
                name: {"offset_s": clock.offset * 1e-9, "uncertainty_s": clock.uncertainty * 1e-9}
                for name in self.bound.peers.names
                for clock in (self.bound.peers.clock_of(name),)
            },
        }
