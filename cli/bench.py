"""``aloft bench``: how fast the runtime is, as ratios to peers in the same process."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..runtime.language.errors import AloftError, ExitCode
from .shared.options import JsonBesideTables, benchmark_names
from .shared.output import console, errors_reported, number, print_json, say, table

if TYPE_CHECKING:
    from rich.console import Console


def bench(
    name: Annotated[
        str, typer.Argument(help="One benchmark; by default all.", autocompletion=benchmark_names)
    ] = "",
    seconds: Annotated[
        float | None,
        typer.Option(help="Length of the run in real time of 'recorder'; by default 60.", min=1.0),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(
            help="How many tasks 'jumps' draws (200), or programs 'agreement' (50000).", min=1
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="The seed by which they are drawn.", min=0)
    ] = None,
    seeds: Annotated[
        str, typer.Option(help="Seeds of the trial for 'frontier' and 'link_delays'.")
    ] = "",
    jitter: Annotated[
        str, typer.Option(help="How much longer messages of 'link_delays' take at most: '1 ms'.")
    ] = "",
    loss: Annotated[
        str, typer.Option(help="The share of messages that 'link_delays' loses: '5 %'.")
    ] = "",
    tsid: Annotated[
        str, typer.Option(help="The folder with the wheels of TSID, a peer of 'tick'.")
    ] = "",
    since: Annotated[
        str, typer.Option(help="A commit whose controller 'tick' measures as well: '65ca00c'.")
    ] = "",
    as_json: JsonBesideTables = False,
) -> None:
    """Measure the runtime beside hand-written loops and peers; exit with 1 if a goal is missed."""
    from ..benchmarks.catalogue import (
        BENCHMARKS,
        COUNTED,
        LINKED,
        PEERED,
        SEEDED,
        TIMED,
        run_benchmarks,
    )
    from ..studies.batch.seeds import parse_seeds

    out = console(to_stderr=as_json)
    with errors_reported(as_json):
        if name and name not in BENCHMARKS:
            raise AloftError(f"there is no benchmark {name!r}; there is {', '.join(BENCHMARKS)}")
        if seconds is not None and name not in TIMED:
            raise AloftError(f"--seconds is for {', '.join(TIMED)}, not for {name or 'all'}")
        if (count, seed) != (None, None) and name not in COUNTED:
            raise AloftError(
                f"--count and --seed are for {', '.join(COUNTED)}, not for {name or 'all'}"
            )
        if seeds and name not in SEEDED:
            raise AloftError(f"--seeds is for {', '.join(SEEDED)}, not for {name or 'all'}")
        if (jitter or loss) and name not in LINKED:
            raise AloftError(
                f"--jitter and --loss are for {', '.join(LINKED)}, not for {name or 'all'}"
            )
        if (tsid or since) and name not in PEERED:
            raise AloftError(
                f"--tsid and --since are for {', '.join(PEERED)}, not for {name or 'all'}"
            )
        chosen = parse_seeds(seeds) if seeds else None
        longer = _number("--jitter", jitter, "s", 1.0, "'1 ms', up to a second")
        lost = _number("--loss", loss, "1", 0.999, "'5 %', less than all")
        with out.status("measuring"):
            results = run_benchmarks(
                [name] if name else None,
                seconds,
                count,
                seed,
                chosen,
                longer,
                lost,
                tsid or None,
                since or None,
            )
    print_results(out, results)
    if as_json:
        print_json(results)
    missed = any(row["met"] is False for row in results["rows"])
    raise typer.Exit(ExitCode.NOT_SUCCESSFUL if missed else ExitCode.SUCCESS)


def _number(option: str, text: str, unit: str, most: float, expected: str) -> float | None:
    """The number in an option's text, from zero to ``most``; none where there is no text.

    Raises:
        AloftError: the text says no such number.
    """
    from ..studies.quantities import in_unit

    if not text:
        return None
    found = in_unit(text, unit)
    if found is None or not 0.0 <= found <= most:
        raise AloftError(f"{option} cannot be {text!r}; expected {expected}")
    return found


def print_results(out: Console, results: Mapping[str, Any]) -> None:
    """Print the rows as a table, with the machine and its load, which explain odd figures."""
    rows = [
        (
            row["name"],
            "" if row["value"] is None else number(row["value"]),
            row["unit"],
            "" if row["ratio"] is None else number(row["ratio"]),
            row["peer"],
            _limit(row["goal"]),
            _limit(row.get("floor")),
            "" if row["met"] is None else number(row["met"]),
            row.get("note", ""),
        )
        for row in results["rows"]
    ]
    columns = ("case", ">value", "unit", ">ratio", "to", ">goal", ">floor", "met", "note")
    out.print(table("", columns, rows))
    machine = results["machine"]
    say(out, f"{machine['processor']}, {machine['cores']} cores, Python {machine['python']}")
    say(out, f"load before {results['load']['before']}, after {results['load']['after']}")


def _limit(value: float | None) -> str:
    return "" if value is None else f"≤ {value:.3g}"
