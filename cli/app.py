"""Puts the verbs together into one command, which ends with an exit code."""

from __future__ import annotations

import atexit
import gc
import sys
import traceback
from collections.abc import Iterable
from copy import copy
from importlib import import_module
from typing import Annotated, Any, cast

import typer

from .. import __version__
from ..runtime.language.errors import ExitCode
from .shared.help_texts import name_values, whole_summaries
from .shared.output import print_error, print_json
from .verbs import CORE, EXIT_CODES

VERBS = tuple(CORE)
"""The verbs of the core, in the order of the help. The file of each has its name, and so has what it
offers: a command, or a group of commands. Extensions declare theirs; see ``runtime.language.extensions``."""

IN_FILE_OF = {"doctor": "check"}
"""Short verbs that stand in the file of another."""

GROUPS = ("robot",)
"""The groups of the core to which extensions may add verbs, declared as ``robot reach``."""


def make_app(verbs: Iterable[str] | None = None, inner: str = "") -> typer.Typer:
    """Make the command line with those verbs, or with all; the files of others are not imported.

    Args:
        verbs: of the core and of extensions.
        inner: the command that is called of a verb that is a group with commands of extensions;
            the others are left out.

    Raises:
        ExtensionError: an extension's declaration is wrong.
    """
    app = typer.Typer(
        name="aloft",
        help="Control loops for robots as typed block diagrams.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    for verb in all_verbs() if verbs is None else verbs:
        offered = _of_the_core(verb, inner) if verb in VERBS else _of_extensions(verb)
        if isinstance(offered, typer.Typer):
            whole_summaries(offered)
            app.add_typer(offered)
        elif offered is not None:
            app.command(verb, epilog="\b\n" + EXIT_CODES if verb == "run" else None)(offered)
    app.callback()(_options)
    return app


def _of_the_core(verb: str, inner: str) -> Any:
    offered = getattr(import_module(f".{IN_FILE_OF.get(verb, verb)}", __package__), verb)
    return _group(offered, verb, inner) if verb in GROUPS else offered


def _group(core: typer.Typer, verb: str, inner: str) -> typer.Typer:
    """Return a group with the commands of the core and of extensions, or with one of them alone."""
    from ..runtime.language.extensions import extensions

    theirs = {
        name.partition(" ")[2]: (each, target)
        for each in extensions()
        for name, target in each.verbs.items()
        if name.startswith(verb + " ")
    }
    ours = {str(each.name): each for each in core.registered_commands}
    one = (inner in ours) != (inner in theirs)  # any other word shows or names them all
    group = copy(core)
    group.registered_commands = [ours[name] for name in ours if not one or name == inner]
    group.registered_groups = list(core.registered_groups)
    for name, (each, target) in theirs.items():
        if not one or name == inner:
            found = each.load(target)
            if isinstance(found, typer.Typer):
                group.add_typer(found, name=name)
            else:
                group.command(name)(found)
    return group


def _of_extensions(verb: str) -> Any:
    from ..runtime.language.extensions import extensions

    for each in extensions():
        if verb in each.verbs:
            return each.load(each.verbs[verb])
    return None


def chosen_verbs(arguments: list[str]) -> tuple[str, ...]:
    """Return the verb that a command line begins with, or all of them where it begins otherwise."""
    if arguments and arguments[0] in VERBS:
        return (arguments[0],)
    return (arguments[0],) if arguments and arguments[0] in _extension_verbs() else all_verbs()


def all_verbs() -> tuple[str, ...]:
    """Return the verbs of the core and of the extensions that are here."""
    return (*VERBS, *_extension_verbs())


def _extension_verbs() -> tuple[str, ...]:
    from ..runtime.language.extensions import extensions

    return tuple(verb for each in extensions() for verb in each.verbs if " " not in verb)


def _why_unknown(arguments: list[str]) -> str:
    """Return the sentence about a verb of an extension that is not here; empty for any other."""
    from ..runtime.language.extensions import SHIPPED, missing_extension, own_extensions

    for name, verbs in SHIPPED.items():
        for verb in all_verbs() if verbs is None else verbs:
            if name not in own_extensions() and verb.split() == arguments[: len(verb.split())]:
                return missing_extension(name, f"'aloft {verb}'")
    return ""


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
    # At its end Python looks for garbage once more, which takes a quarter of the time of a run. What must be
    # closed has been closed by then; registered first, this is called after all others.
    atexit.register(gc.freeze)
    # typer exports only the most special of the errors that a wrong command line raises
    usage_error = cast("type[Exception]", typer.BadParameter.__bases__[0])
    try:
        command = typer.main.get_command(make_app(chosen_verbs(sys.argv[1:]), *sys.argv[2:3]))
        name_values(command)
        code = command(standalone_mode=False)
    except usage_error as caught:
        error: Any = caught
        reason = _why_unknown(sys.argv[1:])
        if "--json" in sys.argv:
            print_json({"success": False, "reason": reason or error.format_message()})
        elif reason:
            print_error(reason)
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
