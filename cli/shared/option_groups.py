"""Options of a verb in groups, so that what belongs together is one argument of the verb.

A group is a data class whose fields are declared as options are::

    @dataclass(frozen=True)
    class PrintingOptions:
        as_json: JsonBesideTables = False
        quiet: Quiet = False

    @expand_option_groups
    def run(graph: ..., printing: PrintingOptions) -> None: ...
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any, get_type_hints


def expand_option_groups(verb: Callable[..., None]) -> Callable[..., None]:
    """The verb as typer reads it: each group of options replaced by its fields, in their place."""
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
