"""The texts of help pages: names of values as a reader has them, and summaries that are not cut."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any, get_args

import typer

NAMES = {"int": "N", "float": "X", "path": "FILE"}
"""The names of values by their types; all others are ``TEXT``."""
UNITS = {"s": "SECONDS", "deg": "DEGREES", "m": "METRES", "Hz": "HERTZ", "pixels": "PIXELS"}
"""The names of numbers whose help begins with their unit in brackets."""
FOLDER = re.compile(r"\b[Ff]older\b")


def name_values(command: Any) -> None:
    """Name the values of all options and arguments of a command, and of those in it."""
    for inner in getattr(command, "commands", {}).values():
        name_values(inner)
    for parameter in command.params:
        if parameter.param_type_name == "argument":
            _name_argument(parameter)
        elif parameter.metavar is None and not parameter.is_flag:
            parameter.metavar = _value_name(parameter)


def _name_argument(parameter: Any) -> None:
    """Show an argument as ``GRAPH``, ``[GRAPH]`` or ``SIGNAL...``, without Python's type."""
    many = parameter.nargs == -1
    name = str(parameter.name).upper()
    parameter.metavar = name.removesuffix("S") if many else name
    shown = parameter.metavar + ("..." if many else "")
    pieces = [shown if parameter.required else f"[{shown}]"]
    parameter.get_usage_pieces = lambda context: pieces
    if hasattr(parameter, "display_type_rich"):
        parameter.display_type_rich = lambda ctx: None


def _value_name(parameter: Any) -> str | None:
    """Return the name of a parameter's value, or None where its choices are listed."""
    kind = _kind(parameter)
    if kind == "choice":
        return None
    text = parameter.help or ""
    if kind in ("int", "float"):
        unit = re.search(r"\[(\w+)", text)
        return UNITS.get(unit[1], NAMES[kind]) if unit else NAMES[kind]
    if kind == "path" and FOLDER.search(text):
        return "FOLDER"
    return NAMES.get(kind, "TEXT")


def _kind(parameter: Any) -> str:
    """Return ``int``, ``float``, ``path``, ``choice`` or another word for a parameter's type.

    Typer keeps the annotation; older versions make a type of click's.
    """
    described = getattr(parameter, "type_descriptor", None)
    if described is None:
        kind = parameter.type
        word = "choice" if getattr(kind, "choices", None) else str(kind.name).split()[0]
        return {"integer": "int", "directory": "path", "file": "path"}.get(word, word)
    annotation = described.annotation
    if getattr(described, "is_choice", False):
        return "choice"
    while arguments := get_args(annotation):  # list[str], or Path | None
        annotation = arguments[0]
    if isinstance(annotation, type):
        if issubclass(annotation, Path):
            return "path"
        return annotation.__name__
    return "text"


def whole_summaries(group: typer.Typer) -> None:
    """Give the commands of a group their first sentence as a summary, which click does not cut."""
    for each in group.registered_commands:
        if each.short_help is None and each.callback is not None:
            each.short_help = first_sentence(inspect.getdoc(each.callback) or "")
    for inner in group.registered_groups:
        if inner.typer_instance is not None:
            whole_summaries(inner.typer_instance)


def first_sentence(text: str) -> str:
    """Return the first sentence of a docstring as one line."""
    paragraph = " ".join(text.partition("\n\n")[0].split())
    return re.split(r"(?<=[.:;]) ", paragraph)[0].rstrip(":;.") + "." if paragraph else ""
