"""``aloft bench``: the speed of the runtime, as ratios to peers in the same process."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...cli.shared.options import JsonBesideTables
from ...cli.shared.output import console, errors_reported, number, print_json, say, table
from ...runtime.language.errors import AloftError, ExitCode

if TYPE_CHECKING:
    from rich.console import Console


def benchmark_names(incomplete: str) -> list[str]:
    """List the names of benchmarks that begin with a text; none where there are no benchmarks."""
    try:
        from ..benchmarks import catalogue

        names = catalogue.BENCHMARKS
    except AloftError:
        return []
    return [name for name in names if name.startswith(incomplete)]


def bench(
    name: Annotated[
        str, typer.Argument(help="One benchmark; by default all.", autocompletion=benchmark_names)
    ] = "",
    seconds: Annotated[
        float | None,
        typer.Option(
            help="Length of the runs in real time of 'recorder' and 'background'; by default 60 and 10.",
            min=1.0,
        ),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(
            help="How many tasks 'jumps' draws (200), programs 'agreement' (50000), or ticks 'export' runs in C (1000000).",
            min=1,
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="The seed of the draws.", min=0)] = None,
    seeds: Annotated[
        str,
        typer.Option(
            help="Seeds of the trial for 'jumps', 'frontier', 'link_delays', 'real_robot', 'known_effects', 'identification' and 'courses'."
        ),
    ] = "",
    jitter: Annotated[
        str, typer.Option(help="Largest extra delay of messages of 'link_delays': '1 ms'.")
    ] = "",
    loss: Annotated[
        str, typer.Option(help="The share of messages that 'link_delays' loses: '5 %'.")
    ] = "",
    tsid: Annotated[
        str, typer.Option(help="The folder with the wheels of TSID, a peer of 'tick' and 'export'.")
    ] = "",
    since: Annotated[
        str,
        typer.Option(
            help="An earlier build, a commit or a folder: 'speed' and 'growth' give ratios to it, 'tick' measures its controller."
        ),
    ] = "",
    everything: Annotated[
        bool, typer.Option("--all", help="Also rows of 'speed' above 5 s, three times each.")
    ] = False,
    arms: Annotated[
        str,
        typer.Option(help="Arms of 'real_robot', separated by semicolons: 'calibrated'."),
    ] = "",
    asked: Annotated[
        str,
        typer.Option(
            help="Jumps of 'real_robot', separated by semicolons: 'in place 12 cm;ten in a row'; or effects of 'known_effects'."
        ),
    ] = "",
    robot: Annotated[
        str,
        typer.Option(
            help="The robot of 'courses', or of 'real_robot' (go2, g1, solo12); by default bruce."
        ),
    ] = "",
    harder: Annotated[
        bool,
        typer.Option("--harder", help="Draw the tasks of 'jumps' up to the limits of what lands."),
    ] = False,
    trial: Annotated[
        str, typer.Option(help="The trial of 'jumps': 'uneven'; by default robust.")
    ] = "",
    push: Annotated[
        str, typer.Option(help="The impulse that the torso gets in a flight of 'jumps': '0.5 N s'.")
    ] = "",
    as_json: JsonBesideTables = False,
) -> None:
    """Measure the runtime beside hand-written loops and peers; exit with 1 if a goal is missed."""
    from ...studies.batch.seeds import parse_seeds

    out = console(to_stderr=as_json)
    with errors_reported(as_json):
        from ..benchmarks import catalogue

        if name and name not in catalogue.BENCHMARKS:
            raise AloftError(
                f"there is no benchmark {name!r}; there is {', '.join(catalogue.BENCHMARKS)}"
            )
        options = {
            "seconds": seconds,
            "count": count,
            "seed": seed,
            "seeds": parse_seeds(seeds) if seeds else None,
            "jitter": _number("--jitter", jitter, "s", 1.0, "'1 ms', up to a second"),
            "loss": _number("--loss", loss, "1", 0.999, "'5 %', less than all"),
            "tsid": tsid or None,
            "since": since or None,
            "everything": everything or None,
            "arms": _names(arms),
            "asked": _names(asked),
            "robot": robot or None,
            "harder": harder or None,
            "trial": trial or None,
            "push": _number("--push", push, "N s", 10.0, "'0.5 N s', up to 10"),
        }
        given = {option: value for option, value in options.items() if value is not None}
        for option in given:
            if name not in (takers := catalogue.OPTIONS[option]):
                raise AloftError(f"--{option} is for {', '.join(takers)}, not for {name or 'all'}")
        with out.status("measuring"):
            results = catalogue.run_benchmarks([name] if name else None, given)
    print_results(out, results)
    if as_json:
        print_json(results)
    missed = any(row["met"] is False for row in results["rows"])
    raise typer.Exit(ExitCode.NOT_SUCCESSFUL if missed else ExitCode.SUCCESS)


def _names(text: str) -> list[str] | None:
    """Split an option's text at its semicolons into names, which have commas of their own."""
    return [name.strip() for name in text.split(";")] if text else None


def _number(option: str, text: str, unit: str, most: float, expected: str) -> float | None:
    """Parse the number in an option's text, from zero to ``most``; none where there is no text.

    Raises:
        AloftError: the text says no such number.
    """
    from ...studies.quantities import in_unit

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
