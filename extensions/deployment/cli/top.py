"""``aloft top`` and ``aloft watch``: the machines of a running graph, as a table or in the viewer."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....cli.shared.options import Overrides
from ....cli.shared.output import console, errors_reported, print_json, table
from ....cli.shared.running_graphs import As, Keys, Local, observer_of
from ....runtime.language.errors import AloftError, ExitCode

if TYPE_CHECKING:
    from rich.console import Group

    from ....runtime.links.observer import Observer


PERIOD = 0.5


def top(
    graph: Annotated[Path, typer.Argument(help="The graph file that the machines run.")],
    once: Annotated[bool, typer.Option("--once", help="Print once and exit.")] = False,
    wait: Annotated[float, typer.Option(min=0.1, help="With --once: seconds to wait.")] = 5.0,
    keys: Keys = None,
    name: As = "viewer",
    local: Local = 0,
    overrides: Overrides = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="With --once: print one JSON object.")
    ] = False,
) -> None:
    """Show what runs on each machine. Nothing is sent; the graph does not notice.

    If the graph runs here with --local, its parts are found at the endpoints that they have there.
    """
    with errors_reported(as_json):
        if as_json and not once:
            raise AloftError("--json is for --once")
        with observer_of(graph, overrides or [], keys, name, local) as observer:
            machines = tuple(spec.name for spec in observer.placed.machines)
            if not once:
                _live(observer)
                return
            missing = observer.wait_for(machines, wait)
            about = report(observer)
            if as_json:
                found = "; ".join(f"{name}: {observer.why_silent(name)}" for name in missing)
                print_json({"success": not missing, "reason": found, "machines": about})
            else:
                console().print(_tables(observer))
                for machine in missing:
                    typer.echo(f"{machine}: {observer.why_silent(machine)}", err=True)
    raise typer.Exit(ExitCode.NOT_SUCCESSFUL if missing else ExitCode.SUCCESS)


def report(observer: Observer) -> dict[str, Any]:
    """Return the status of each machine; of one that was never heard only its state."""
    return {
        spec.name: {
            "state": observer.state_of(spec.name),
            "silent_s": observer.seconds_since(spec.name),
            **observer.statuses.get(spec.name, {}),
        }
        for spec in observer.placed.machines
    }


def _live(observer: Observer) -> None:
    from rich.live import Live

    with (
        suppress(KeyboardInterrupt),
        Live(_tables(observer), console=console(), screen=False, auto_refresh=False) as shown,
    ):
        while True:
            time.sleep(PERIOD)
            shown.update(_tables(observer), refresh=True)


def _lateness(found: Mapping[str, float] | None) -> str:
    """Format how late ticks begin; empty where they have no deadlines."""
    if not found:
        return ""
    return ", ".join(f"{found[key]:.3g}" for key in ("p50_us", "p99_us", "max_us"))


def _tables(observer: Observer) -> Group:
    from rich.console import Group

    machines, links = [], []
    for name, found in report(observer).items():
        known = "tick" in found
        machines.append(
            (
                name,
                str(found["state"]),
                str(found["tick"]) if known else "",
                f"{found['rate_hz']:.1f} of {found['base_rate_hz']:g}" if known else "",
                str(found["overruns"]) if known else "",
                str(found["skipped_periods"]) if known else "",
                _lateness(found.get("lateness")),
                str(found.get("late_results", "")),
                "" if found["silent_s"] is None else f"{found['silent_s']:.1f}",
            )
        )
        for link in found.get("links", ()):
            links.append(
                (
                    link["name"],
                    str(link["received"]),
                    f"{link['age_ms']:.1f}" if "age_ms" in link else "",
                    f"{link['jitter_ms']:.2f}" if "jitter_ms" in link else "",
                    str(link.get("late_ticks", "")),
                    str(link.get("lost", "")),
                    str(link["damaged"]),
                    str(link["surplus"]),
                )
            )
    columns: tuple[str, ...] = (
        "machine",
        "state",
        ">tick",
        ">rate [Hz]",
        ">overruns",
        ">skipped",
        ">ticks began late by [us]: median, 99 %, longest",
        ">late results",
        ">heard [s ago]",
    )
    parts = [table(observer.placed.graph.name, columns, machines)]
    if links:
        columns = ("link", ">messages", ">age [ms]", ">jitter [ms]", ">late ticks", ">lost", ">damaged",
                   ">twice or late")  # fmt: skip
        parts.append(table("", columns, links))
    return Group(*parts)


def watch(
    graph: Annotated[Path, typer.Argument(help="The graph file that the machines run.")],
    machine: Annotated[str, typer.Argument(help="The machine whose signals are shown.")],
    web: Annotated[bool, typer.Option("--web", help="In a browser.")] = False,
    keys: Keys = None,
    name: As = "viewer",
    local: Local = 0,
    overrides: Overrides = None,
) -> None:
    """Show a machine's signals live, 50 times a second, until Ctrl-C. Nothing is sent to it."""
    from ....logs.recording.live_feed import WatchedPart
    from ....logs.viewing.viewer import start_viewer

    with (
        errors_reported(False),
        observer_of(graph, overrides or [], keys, name, local) as observer,
    ):
        observer.placed.machine(machine)
        if observer.wait_for((machine,), 10.0):
            raise AloftError(f"nothing was heard of {machine!r} for 10 s: does it run?")
        if observer.state_of(machine) == "another graph":
            raise AloftError(f"{machine!r} runs another graph than {graph}")
        viewer = start_viewer("web" if web else "window")
        try:
            typer.echo(
                f"live view: {viewer.page}" if web else "live view: Ctrl-C ends it", err=True
            )
            shown = WatchedPart(observer, machine, viewer.source)
            with suppress(KeyboardInterrupt):
                while viewer.is_alive() and not shown.problem:
                    time.sleep(0.1)
            shown.close()
            if shown.problem:
                raise AloftError(shown.problem)
        finally:
            viewer.stop()
