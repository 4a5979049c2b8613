"""Puts the verbs together into one command, which ends with an exit code."""

from __future__ import annotations

import sys
import traceback
from typing import Annotated, Any, cast

import typer

from .. import __version__
from ..runtime.language.errors import ExitCode
from .bench import bench
from .blocks import blocks
from .check import check
from .graph import graph
from .log import log
from .output import print_json
from .params import params
from .plan import plan
from .replay import replay
from .robot import robot
from .run import run
from .study import study
from .test import test
from .view import view

EXIT_CODES = """\b
Exit codes:
  0    the graph ran and its own criteria hold
  1    it ran to its end, but a criterion failed: a fall, a missed target
  2    the graph, an override or the command line is wrong; nothing moved
  3    a block failed, a signal was not finite, or a policy ended the run
  130  stopped cleanly by SIGINT
  143  stopped cleanly by SIGTERM
"""

app = typer.Typer(
    name="aloft",
    help="Run, check and look at graphs of blocks.",
    epilog=EXIT_CODES,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for _verb in (run, view, replay, check, graph, blocks, plan, bench, study, test):
    app.command(epilog=EXIT_CODES if _verb is run else None)(_verb)
app.add_typer(params)
app.add_typer(log)
app.add_typer(robot)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"aloft {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command line and leave with one of ``ExitCode``."""
    # typer exports only the most special of the errors that a wrong command line raises
    usage_error = cast("type[Exception]", typer.BadParameter.__bases__[0])
    try:
        code = app(standalone_mode=False)
    except usage_error as caught:
        error: Any = caught
        if "--json" in sys.argv:
            print_json({"success": False, "reason": error.format_message()})
        else:
            error.show()
        code = ExitCode.BAD_INPUT
    except (typer.Abort, KeyboardInterrupt):
        code = ExitCode.INTERRUPTED
    except BrokenPipeError:  # `aloft ... | head`
        sys.stderr.close()
        code = ExitCode.SUCCESS
    except Exception as bug:  # noqa: BLE001  # whatever it is, it must not look like a fall
        traceback.print_exc()
        if "--json" in sys.argv:
            print_json({"success": False, "reason": f"bug: {type(bug).__name__}: {bug}"})
        code = ExitCode.RUN_FAILED
    sys.exit(int(code or 0))
