"""Puts the verbs together into one command, which ends with an exit code."""

from __future__ import annotations

import atexit
import gc
import sys
import traceback
from collections.abc import Iterable
from importlib import import_module
from typing import Annotated, Any, cast

import typer

from .. import __version__
from ..runtime.language.errors import ExitCode
from .shared.output import print_json

EXIT_CODES = """\b
Exit codes:
  0    the graph ran and its own criteria hold
  1    it ran to its end, but a criterion failed: a fall, a missed target
  2    the graph, an override or the command line is wrong; nothing moved
  3    a block failed, a signal was not finite, or a policy ended the run
  4    the run went well, but its recording could not be written, or not all of it
  130  stopped cleanly by SIGINT
  137  a block hung in compiled code; the process was killed
  143  stopped cleanly by SIGTERM
"""

VERBS = (
    "new", "run", "jump", "stand", "steer", "view", "render", "plot", "replay", "branch", "explain", "check", "graph", "graphs", "blocks", "plan", "bench", "study", "tune", "falsify", "test", "params", "export", "linearise", "trim",
    "keys", "deploy", "top", "watch", "log", "robot", "twin", "doctor", "language-server",
)  # fmt: skip
"""All verbs, in the order of the help. The file of each has its name, and so has what it offers:
a command, or a group of commands."""

IN_FILE_OF = {"graphs": "check", "doctor": "check", "watch": "top"}
"""Short verbs that stand in the file of another."""


ONLY_READ = ("check", "graph", "graphs", "blocks")
"""The verbs that leave nothing to be closed at the end of the process."""


def make_app(verbs: Iterable[str] = VERBS) -> typer.Typer:
    """Make the command line with those verbs; the files of others are not imported."""
    app = typer.Typer(
        name="aloft",
        help="Run, check and look at graphs of blocks.",
        epilog=EXIT_CODES,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    for verb in verbs:
        name = verb.replace("-", "_")
        offered = getattr(import_module(f".{IN_FILE_OF.get(verb, name)}", __package__), name)
        if isinstance(offered, typer.Typer):
            app.add_typer(offered)
        else:
            app.command(epilog=EXIT_CODES if verb == "run" else None)(offered)
    app.callback()(_options)
    return app


def asked_for(arguments: list[str]) -> tuple[str, ...]:
    """Return the verb that a command line begins with, or all of them where it begins otherwise."""
    return (arguments[0],) if arguments and arguments[0] in VERBS else VERBS


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"aloft {__version__}")
        raise typer.Exit


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
    if any(verb in ONLY_READ for verb in sys.argv[1:2]):
        # At its end Python looks for garbage once more, which takes a quarter of the time of a check.
        atexit.register(gc.freeze)
    # typer exports only the most special of the errors that a wrong command line raises
    usage_error = cast("type[Exception]", typer.BadParameter.__bases__[0])
    try:
        code = make_app(asked_for(sys.argv[1:]))(standalone_mode=False)
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
