"""``aloft test``: run tests of blocks, or turn a stretch of a recording into one."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..runtime.language.errors import AloftError, ExitCode, UnknownBlockError
from .shared.options import AsJson, Trust
from .shared.output import console, errors_reported, print_json, print_warning, say, table

if TYPE_CHECKING:
    from rich.console import Console

    from ..robots.robot_description import RobotDescription
    from ..runtime.language.block import Block

Row = tuple[str, str, str]
"""A block, the name of a check, and what is wrong, empty if nothing is."""


def test(
    targets: Annotated[
        list[str] | None,
        typer.Argument(
            help="Blocks (mypkg:MyBlock), graph files (all their blocks), or Python files and "
            "folders for pytest; by default pytest in this folder."
        ),
    ] = None,
    recording: Annotated[
        Path | None, typer.Option("--recording", help="Write a test from this recording.")
    ] = None,
    block: Annotated[
        str, typer.Option(help="With --recording: the block's path in the graph.")
    ] = "",
    ticks: Annotated[
        str, typer.Option(help="With --recording: the ticks, e.g. 1200:1400 (1400 excluded).")
    ] = "",
    output: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="With --recording: the file; by default test_BLOCK_FIRST_LAST.py in tests/.",
        ),
    ] = None,
    rtol: Annotated[
        float, typer.Option(min=0.0, help="With --recording: relative tolerance.")
    ] = 0.0,
    atol: Annotated[
        float, typer.Option(min=0.0, help="With --recording: absolute tolerance.")
    ] = 0.0,
    robot: Annotated[
        str,
        typer.Option(help="The robot for blocks that need one; by default the graph's, or bruce."),
    ] = "",
    folder: Annotated[
        Path | None,
        typer.Option(
            help="With --recording: where the graph file's folder is now, if it has moved."
        ),
    ] = None,
    trust: Trust = False,
    as_json: AsJson = False,
) -> None:
    """Check that blocks keep what every block promises, and run your own tests with pytest.

    With --recording, write a test instead: the block's state, inputs and outputs in a stretch of a
    recorded run, which it must reproduce to the last bit.
    """
    out = console(to_stderr=as_json)
    with errors_reported(as_json):
        if recording is not None:
            if targets:
                raise AloftError("with --recording there is nothing else to test")
            tolerances = rtol, atol
            write(recording, block, ticks, output, tolerances, folder, out, trust, as_json)
            return
        if block or ticks or output:
            raise AloftError("--block, --ticks and --out go with --recording FILE")
        blocks, paths = sort_targets(targets or [])
        rows = [row for each in blocks for row in check(each, robot)]
    passed = report(rows, out)
    code = run_pytest(paths, as_json) if paths or not targets else None
    good = passed and code in (None, 0)
    if as_json:
        checks = [{"block": b, "check": c, "problem": p} for b, c, p in rows]
        print_json({"success": good, "checks": checks, "pytest_exit_code": code})
    raise typer.Exit(ExitCode.SUCCESS if good else ExitCode.NOT_SUCCESSFUL)


@dataclass(frozen=True)
class Target:
    """A block to test: with example parameters, or as a graph sets it and with the graph's robot."""

    name: str
    block_type: type[Block]
    params: dict[str, Any] | None = None
    robot: RobotDescription | str | None = "bruce"
    rate: float = 500.0
    dimensions: Mapping[str, int] = field(default_factory=dict)


def sort_targets(targets: list[str]) -> tuple[list[Target], list[str]]:
    """Sort the targets into blocks, and paths for pytest.

    Raises:
        LoadError: a graph may not run.
        AloftError: a target is nothing that can be tested.
    """
    from ..runtime.loading import checked_file
    from ..runtime.loading.checking.parameters import plain_parameters

    blocks: list[Target] = []
    paths = []
    for target in targets:
        path = Path(target.partition("::")[0])
        if path.suffix in (".yaml", ".yml"):
            graph = checked_file(path)
            blocks += [
                Target(
                    f"{spec.path} ({spec.block_type.__name__})",
                    spec.block_type,
                    plain_parameters(spec.params),
                    graph.robot,
                    graph.base_rate / spec.period_ticks,
                    spec.dimensions,
                )
                for spec in graph.blocks
                if "~" not in spec.path
            ]
        elif path.exists():
            paths.append(target)
        else:
            blocks += _blocks_named(target)
    return blocks, paths


def _blocks_named(target: str) -> list[Target]:
    """Return the block of that name, or all that a module defines.

    Raises:
        AloftError: there is neither, or the module cannot be imported.
    """
    from ..runtime.language.block import Block
    from ..runtime.language.importing import find_source, user_module
    from ..runtime.language.registry import find_block

    here = Path.cwd()
    try:
        return [Target(target, find_block(target, here))]
    except UnknownBlockError:
        if ":" in target or find_source(target, [here]) is None:
            raise
    module = user_module(target, [here])
    own = [
        each
        for each in vars(module).values()
        if isinstance(each, type) and issubclass(each, Block) and each.__module__ == module.__name__
    ]
    if not own:
        raise AloftError(f"the module {target} defines no block")
    return [Target(f"{target}:{each.__name__}", each) for each in own]


def check(target: Target, robot: str) -> list[Row]:
    """Run the checks of one block, one for each promise of every block.

    A ``robot`` that is named takes the place of the target's own.
    """
    from ..runtime.testing.conformance import (
        ConformanceError,
        check_block,
        conformance_cases,
        missing_examples,
    )

    lacks = missing_examples(target.block_type) if target.params is None else ""
    if lacks:
        return [(target.name, "example_parameters", lacks)]
    rows = []
    for case in conformance_cases():
        problem = ""
        try:
            check_block(
                target.block_type,
                target.params,
                robot=robot or target.robot,
                rate=target.rate,
                dimensions=target.dimensions,
                cases=[case],
            )
        except ConformanceError as error:
            problem = str(error)
        except Exception as error:  # noqa: BLE001  the other checks still count
            problem = f"{type(error).__name__}: {error}"
        rows.append((target.name, case, problem))
    return rows


def report(rows: list[Row], out: Console) -> bool:
    """Print what is wrong and how many checks passed. Returns whether all have."""
    wrong = [row for row in rows if row[2]]
    if wrong:
        out.print(table("", ("block", "check", "what is wrong"), wrong))
    if rows:
        names = len(dict.fromkeys(row[0] for row in rows))
        blocks = f"{names} block{'s' if names > 1 else ''}"
        say(out, f"{len(rows) - len(wrong)} of {len(rows)} checks of {blocks} passed")
    return not wrong


def run_pytest(paths: list[str], as_json: bool) -> int:
    """Run pytest on some paths, or in this folder, and return its exit code.

    A folder without tests is no failure.
    """
    if find_spec("pytest") is None:
        print_warning("no tests were run: pytest is not installed; pip install pytest")
        return 1
    command = [sys.executable, "-m", "pytest", *paths]
    if as_json:  # standard output is for the object alone
        done = subprocess.run(
            command, check=False, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        sys.stderr.write(done.stdout)
    else:
        done = subprocess.run(command, check=False, text=True)
    return 0 if done.returncode == 5 and not paths else done.returncode


def write(
    recording: Path,
    block: str,
    ticks: str,
    output: Path | None,
    tolerances: tuple[float, float],
    folder: Path | None,
    out: Console,
    trust: bool,
    as_json: bool,
) -> None:
    """Write a test from a recording. Raises ``AloftError``."""
    from ..logs.replay.opened_run import OpenedRun
    from ..logs.replay.regression import write_test

    if not recording.is_file():
        raise AloftError(f"there is no recording {recording}")
    if not block or not ticks:
        raise AloftError("--recording needs --block NAME and --ticks FIRST:END")
    first, last = parse_ticks(ticks)
    opened = OpenedRun.of(
        recording, folder, restore=False, trust=trust
    )  # the test names present files
    if output is None:
        start = Path("tests") if Path("tests").is_dir() else Path()
        output = start / f"test_{block.replace('/', '_')}_{first}_{last}.py"
    try:
        written = write_test(
            opened,
            block,
            first,
            last,
            output,
            source=str(recording),
            rtol=tolerances[0],
            atol=tolerances[1],
        )
    except OSError as error:
        raise AloftError(f"{output} cannot be written ({error.strerror or error})") from error
    if written.difference is not None:
        print_warning(f"the block as it is now fails this test: {written.difference}")
    if as_json:
        differs = None if written.difference is None else str(written.difference)
        print_json(
            {"success": True, "test": str(written.test), "data": str(written.data),
             "runs": written.runs, "differs_now": differs}
        )  # fmt: skip
        return
    say(out, f"{written.test}: {written.runs} runs of {block}; data in {written.data}")
    say(out, f"to run it: pytest {written.test}")


def parse_ticks(text: str) -> tuple[int, int]:
    """Parse ``1200:1400`` as two numbers. Raises ``AloftError``."""
    first, colon, last = text.partition(":")
    try:
        return int(first), int(last) if colon else int(first) + 1
    except ValueError:
        raise AloftError(f"ticks {text!r} are no range like 1200:1400") from None
