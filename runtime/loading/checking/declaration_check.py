"""Checks how the blocks that a graph uses are declared in Python: ``emit`` and input defaults."""

from __future__ import annotations

import numpy as np

from ...language.feedthrough import inputs_read_by_emit
from ...language.stages import Position
from ..problems import Code, Problems, listing, nearest
from .draft import Draft


def check_emit(draft: Draft, problems: Problems) -> None:
    """Report every input that the ``emit`` of a Moore block reads."""
    assert draft.block_type is not None
    flat = draft.flat
    for read in inputs_read_by_emit(draft.block_type):
        problems.add(
            Code.BLOCK_DECLARATION,
            f"{flat.use}: emit reads the input {read.name!r}, but what it writes must follow from "
            "the state alone",
            flat.use_where,
            at=f"{flat.path}.{read.name}",
            other=read.method,
            other_where=Position(read.file, read.line, 1),
            expected="inputs are read in update, which runs when all outputs of the tick are there",
            found=f"self.{read.name} in {read.method}",
            fix=f"read {read.name!r} in update and keep it in the state; or, if the output is to "
            "follow from it in the same tick, write step in place of emit and update",
        )


def check_defaults(draft: Draft, problems: Problems) -> None:
    """Report defaults of unwired inputs that name an unknown field or have the wrong shape."""
    flat = draft.flat
    for name, port in draft.inputs.items():
        if name in flat.wires:
            continue
        for field_name, value in (port.default or {}).items():
            field = port.signal.fields.get(field_name)
            shape = draft.shape(field) if field is not None else None
            if field is None:
                message = f"{port.signal.__name__} has no field {field_name!r}"
                expected, found = listing(port.signal.fields), field_name
            elif shape is not None and np.shape(value) not in ((), shape):
                message = f"{field_name} has another shape"
                expected, found = f"{list(shape)}, or one number", str(list(np.shape(value)))
            else:
                continue
            problems.add(
                Code.BLOCK_DECLARATION,
                f"{flat.use}: the default of the input {name!r} does not fit: {message}",
                flat.use_where,
                at=f"{flat.path}.{name}",
                expected=expected,
                found=found,
                nearest=nearest(field_name, port.signal.fields) if field is None else (),
                fix=f"wire {name!r}, or correct its default in Python",
            )
