"""Reads a fault from one line, as a command line gives it."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError

from ...runtime.language.errors import AloftError
from .faults import Fault


def read_fault(text: str) -> Fault:
    """The fault of a text such as ``dead 0.5 left_knee_motor`` or ``lost 1 * share=0.1``: the kind,
    its start in seconds, its target (``*`` for all), and further settings.

    Raises:
        AloftError: it is none; the message says what is wrong.
    """
    settings: dict[str, Any] = {}
    names = ["kind", "start", "target"]
    for word in text.split():
        name, equals, value = word.partition("=")
        if not equals:
            if not names:
                raise AloftError(f"fault {text!r}: {word!r} is one word too many")
            name, value = names.pop(0), word
        settings[name] = "" if value == "*" else value
    try:
        return Fault.model_validate(settings)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        what = ".".join(str(part) for part in first["loc"])
        raise AloftError(f"fault {text!r}: {what}: {first['msg']}") from error
