"""The options that several verbs have, and what the shell offers for them when the tab key is pressed.

A verb of many options takes them in groups, so that what belongs together is one argument. A group is
a data class whose fields are declared as options are::

    @dataclass(frozen=True)
    class PrintingOptions:
        as_json: JsonBesideTables = False
        quiet: Quiet = False

    @expand_option_groups
    def run(graph: ..., printing: PrintingOptions) -> None: ...
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from ...runtime.language.errors import AloftError
from .output import SET_HELP

if TYPE_CHECKING:
    from ...logs.replay.opened_run import OpenedRun


def opened_recording(
    recording: Path, folder: Path | None, *, look: bool = False, trust: bool = False
) -> OpenedRun:
    """Open the recorded run of a verb's arguments, to ``look`` at it or to run it again.

    Raises:
        AloftError: there is none.
    """
    from ...logs.replay.opened_run import OpenedRun

    if not recording.is_file():
        raise AloftError(f"there is no recording {recording}")
    return OpenedRun.of(recording, folder, look=look, trust=trust)


def block_names(incomplete: str) -> list[str]:
    """List the names of blocks that begin with a text."""
    from ...runtime.language.registry import known_names

    return [name for name in known_names() if name.startswith(incomplete)]


def parameter_names(context: typer.Context, incomplete: str) -> list[str]:
    """List the parameters, as ``block.parameter=``, of the graph on the command line that begin
    with a text."""
    from ...logs.file.code import code_of, is_trusted
    from ...runtime.language.importing import without_imports
    from ...runtime.language.parameters import declared_fields
    from ...runtime.loading import LoadError, checked_file, flatten

    # Arguments in front of an option that still waits for its value are not parsed yet.
    given = context.params.get("graph") or next(iter(context.args), "")
    try:
        known = all(map(is_trusted, code_of(flatten(str(given)))))
        with nullcontext() if known else without_imports():  # a key runs no code that never ran
            graph = checked_file(str(given))
    except LoadError:
        return []  # no graph yet, or one that may not run: nothing to offer
    names = [
        f"{spec.path}.{name}="
        for spec in graph.blocks
        for name, _ in declared_fields(type(spec.params))
        if "~" not in spec.path  # those that loading has inserted cannot be set
    ]
    return [name for name in names if name.startswith(incomplete)]


AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
JsonBesideTables = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on stdout (tables go to stderr).")
]
GraphFolder = Annotated[
    Path | None,
    typer.Option("--folder", help="The graph file's folder, if it has moved."),
]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="Run the code outside aloft that the recording names; remembered until that code changes.",
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Only print pass or fail.")]
NoRecord = Annotated[bool, typer.Option("--no-record", help="Write no recording.")]
Overrides = Annotated[list[str] | None, typer.Option("--set", help=SET_HELP)]
CompletedOverrides = Annotated[
    list[str] | None, typer.Option("--set", help=SET_HELP, autocompletion=parameter_names)
]
Workers = Annotated[int, typer.Option(help="Worker processes; 0: one per core.", min=0)]
RunsFolder = Annotated[
    Path | None, typer.Option("--out", help="Folder for the runs; by default results/NAME.")
]
StudySeeds = Annotated[
    str, typer.Option("--seeds", help="Seeds in place of the study's: 0:4 for a quick look.")
]
Cluster = Annotated[str, typer.Option(help="Run on a Dask cluster: tcp://127.0.0.1:8786.")]


def expand_option_groups(verb: Callable[..., None]) -> Callable[..., None]:
    """Return the verb as typer reads it: each group of options replaced by its fields, in their
    place."""
    kinds = get_type_hints(verb, include_extras=True)
    groups: dict[str, Any] = {name: kind for name, kind in kinds.items() if is_dataclass(kind)}
    options: list[Parameter] = []
    for name, parameter in signature(verb).parameters.items():
        if name in groups:
            declared = get_type_hints(groups[name], include_extras=True)
            options += [
                _option(each.name, each.default, declared[each.name])
                for each in fields(groups[name])
            ]
        else:
            options.append(_option(name, parameter.default, kinds[name]))

    @wraps(verb)
    def command(**values: Any) -> None:
        for name, group in groups.items():
            values[name] = group(**{each.name: values.pop(each.name) for each in fields(group)})
        verb(**values)

    command.__annotations__ = {option.name: option.annotation for option in options}
    setattr(command, "__signature__", Signature(options))  # noqa: B010  mypy: no such attribute
    return command


def _option(name: str, default: Any, annotation: Any) -> Parameter:
    return Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
