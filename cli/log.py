"""``aloft log``: prints what is in recordings, exports them and repairs them."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ..runtime.language.errors import AloftError, ExitCode
from .log_import import import_log
from .shared.options import AsJson
from .shared.output import console, errors_reported, number, print_json, print_warning, say, table
from .shared.viewing import read

if TYPE_CHECKING:
    from ..logs.file.reader import RecordedRun

log = typer.Typer(
    name="log",
    help="Inspect, export, compare, merge and repair recordings, and import logs.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

File = Annotated[Path, typer.Argument(help="The recording, a .rrd file.")]
log.command("import")(import_log)


@log.command("info")
def info(file: File, as_json: AsJson = False) -> None:
    """Print what ran, its outcome, and every signal with its unit."""
    with errors_reported(as_json):
        run = read(file, damaged=True)
        about = summary(run)
    if as_json:
        print_json({"success": not run.damage, **about})
        raise typer.Exit(ExitCode.NOT_SUCCESSFUL if run.damage else ExitCode.SUCCESS)
    out = console()
    rows = [
        (key, plain(value))
        for key, value in about.items()
        if key not in ("signals", "notes", "damage")
    ]
    out.print(table(str(file), ("", ""), rows))
    fields = [
        (s["name"], s["dtype"], plain(s["shape"]), s["unit"] or "", s["frame"] or "", s["text"])
        for s in about["signals"]
    ]
    columns = ("signal", "type", "shape", "unit", "frame", "what it is")
    out.print(table("signals", columns, fields))
    notes = [(str(note["tick"]), note["level"], note["text"]) for note in about["notes"]]
    out.print(table("what happened", (">tick", "", "note"), notes))
    for each in run.damage:
        print_warning(f"{file} is damaged: {each}")
    if run.damage:
        raise typer.Exit(ExitCode.NOT_SUCCESSFUL)


@log.command("export")
def export(
    file: File,
    csv: Annotated[bool, typer.Option("--csv", help="Comma-separated values.")] = False,
    parquet: Annotated[bool, typer.Option("--parquet", help="Apache Parquet.")] = False,
    mcap: Annotated[
        bool,
        typer.Option(
            "--mcap",
            help="MCAP, for Foxglove and PlotJuggler (extra mcap).",
        ),
    ] = False,
    bag: Annotated[
        bool,
        typer.Option("--bag", help="A ROS 2 bag, a folder (extra mcap)."),
    ] = False,
    signal: Annotated[
        list[str] | None,
        typer.Option(help="Only this signal, port or block; may be given several times."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="The file to write; by default beside the recording."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write the signals of a recording, every number exact, into a file of another format."""
    from ..logs.exporting.export import export as write_export
    from ..logs.recording.output_file import remedy

    with errors_reported(as_json):
        asked = {"csv": csv, "parquet": parquet, "mcap": mcap, "bag": bag}
        kinds = [kind for kind, on in asked.items() if on]
        if len(kinds) != 1:
            raise AloftError("say one of --csv, --parquet, --mcap and --bag")
        # a folder that ends with .bag is taken for a file of ROS 1
        name = f"{file.stem}_bag" if bag else f"{file.stem}.{kinds[0]}"
        target = output or file.with_name(name)
        run = read(file)
        try:
            write_export(kinds[0], run, target, signal or ())
        except KeyError as error:
            raise AloftError(str(error.args[0])) from None
        except OSError as error:
            why, fix = (
                error.strerror or error,
                remedy(error.errno or 0, target, "-o FILE writes elsewhere"),
            )
            raise AloftError(f"{target} cannot be written: {why}; {fix}") from None
    if as_json:
        print_json({"success": True, "file": str(target), "ticks": len(run.ticks)})
    else:
        say(console(), f"{len(run.ticks)} ticks in {target}")


@log.command("compare")
def compare(
    first: File,
    second: Annotated[Path, typer.Argument(help="The recording to compare it with.")],
    align: Annotated[
        Literal["lift-off", "start"] | None,
        typer.Option(
            help="The event at which the runs are aligned; by default lift-off, if both have one."
        ),
    ] = None,
    most: Annotated[int, typer.Option("--most", min=1, help="How many signals to show.")] = 20,
    as_json: AsJson = False,
) -> None:
    """Align two runs and print which signals differ most, where, and by how much."""
    from ..logs.exporting.difference import compare_runs

    with errors_reported(as_json):
        found = compare_runs(read(first), read(second), align)
    if as_json:
        print_json({"success": True, **asdict(found)})
        return
    out = console()
    if not found.signals:
        say(out, f"all {found.equal} signals are equal in {found.ticks} ticks")
    else:
        rows = [
            (d.signal, d.element, f"{d.largest:.4g} {d.unit}".strip(), f"{d.at:+.3f} s",
             f"{d.rms:.3g}", "was constant" if d.share is None else f"{d.share:.1%}")
            for d in found.signals[:most]
        ]  # fmt: skip
        columns = ("signal", "element", ">largest", ">at", ">rms", ">of its range")
        title = f"{first} and {second}, aligned at {found.align}"
        out.print(table(title, columns, rows))
        say(out, f"{found.equal} signals are equal and {len(found.signals)} differ; "
            f"{found.ticks} ticks were compared")  # fmt: skip
    for name, names in ((first, found.only_first), (second, found.only_second)):
        if names:
            say(out, f"only {name} has {len(names)} signals: {', '.join(names[:5])}")


@log.command("repair")
def repair(file: File, as_json: AsJson = False) -> None:
    """Repair a recording: write all that is intact of it into a new file of its name."""
    from ..logs.recording.output_file import finished_name, is_being_written
    from ..logs.recording.repair import repair as mend

    with errors_reported(as_json):
        try:
            if is_being_written(file):
                raise AloftError(f"{file} is being written just now; wait for the end of the run")
            done = mend(file)
            name = finished_name(file)
            if name is not None and not name.exists():
                file = file.rename(name)
        except OSError as error:
            raise AloftError(f"{file} cannot be mended: {error.strerror or error}") from None
        run = read(file)
    ticks = run.ticks
    last = int(ticks[-1]) if len(ticks) else None
    if as_json:
        found: dict[str, Any] = {
            "closed": done.closed,
            "size_before": done.size_before,
            "size": done.size,
            "records": done.records,
        }
        found |= {"damage": [str(each) for each in done.damage], "file": str(file)}
        print_json({"success": True, **found, "ticks": len(ticks), "last_tick": last})
        return
    if done.was_whole:
        say(console(), f"{file} is whole: nothing was done")
        return
    for each in done.damage:
        say(console(), f"damage was taken out: {each}")
    cut = "" if done.closed or done.damage else (
        "it was not closed by who wrote it, and what came after is lost; "
    )  # fmt: skip
    kept = f"{len(ticks)} ticks are kept, the last is {last}" if len(ticks) else "no tick is kept"
    say(console(), f"{file} is mended: {cut}{kept}")


@log.command("merge")
def merge(
    files: Annotated[list[Path], typer.Argument(help="The recordings of all parts of one run.")],
    output: Annotated[Path, typer.Option("--out", "-o", help="The recording to write.")],
    as_json: AsJson = False,
) -> None:
    """Put the recordings of a run's parts, made on several machines, together into one."""
    from ..files.problems import LoadError
    from ..logs.recording.merged_run import (
        check_all_machines,
        joined_blocks,
        machine_of,
        merge_recordings,
        merged_outcome,
        read_parts,
        run_hash_of,
    )
    from ..logs.replay.opened_run import OpenedRun
    from ..runtime.placement.placed import split_over_machines

    with errors_reported(as_json):
        runs = {file: read(file) for file in files}
        opened = OpenedRun.of(files[0], look=True)
        blocks = joined_blocks(list(runs.values()))
        header = replace(opened.file.header, blocks=blocks)
        whole = replace(opened, file=replace(opened.file, header=header))
        try:
            placed = split_over_machines(whole.graph)
        except LoadError:
            check_all_machines(runs)  # nothing is known of the blocks of a part without a recording
            raise
        paths: dict[str, Path] = {}
        for file, run in runs.items():
            machine = machine_of(placed, run)
            if machine in paths:
                raise AloftError(f"{paths[machine]} and {file} are both of machine {machine!r}")
            paths[machine] = file
        parts = read_parts(placed, paths)
        run_hash, ticks = run_hash_of(placed, parts)
        outcome = merged_outcome(placed, parts, run_hash, ticks)
        try:
            written = merge_recordings(output, placed, parts, outcome)
        except OSError as error:
            raise AloftError(f"{output} cannot be written: {error.strerror or error}") from error
    if as_json:
        about = {"recording": str(written), "run_hash": run_hash, "ticks": ticks}
        print_json({"success": True, **about})
        return
    count = f"{ticks} ticks of {len(parts)} parts"
    typer.echo(f"{written}: {count}, run hash {run_hash}; `aloft replay --check {written}` runs it")


def summary(run: RecordedRun) -> dict[str, Any]:
    """Summarise a recording as plain data."""
    header, outcome, ticks = run.header, run.outcome, run.ticks
    duration = len(ticks) / header.base_rate
    return {
        "graph": header.name,
        "whole": run.whole,
        "rewritten": run.scan.rewritten is not None,
        "damage": [str(each) for each in run.damage],
        "outcome": outcome["reason"] if outcome else None,
        "run_hash": outcome["run_hash"] if outcome else None,
        "ticks": len(ticks),
        "duration_s": duration,
        "base_rate_hz": header.base_rate,
        "clock": header.clock,
        "dropped_ticks": run.dropped_ticks,
        "missing_ticks": run.missing_ticks,
        "keyframes": len(run.keyframes),
        "parameter_changes": len(run.parameter_changes),
        "size_bytes": run.path.stat().st_size,
        "overrides": dict(header.overrides),
        "seeds": dict(header.seeds),
        "versions": dict(header.versions),
        "machine": dict(header.machine),
        "files": dict(header.files),
        "project": header.project,
        "schema_hashes": header.schema_hashes,
        "signals": [
            {"name": f.name, "dtype": f.dtype, "shape": list(f.shape), "unit": f.unit,
             "frame": f.frame, "text": f.text}
            for f in run.signals().values()
        ],
        "notes": [
            {"tick": n.tick, "kind": n.kind, "level": n.level, "text": n.text} for n in run.notes
        ],
    }  # fmt: skip


def plain(value: Any) -> str:
    """Write a value as the text of a table's cell."""
    if isinstance(value, dict):
        return ", ".join(f"{key} {entry}" for key, entry in value.items())
    if isinstance(value, list):
        return " x ".join(map(str, value))
    return "" if value is None else number(value)
