"""The code of kernels with loops in place of equations, kept between processes: a start calls a few of them as plain
Python, and rewriting one takes as long as reading all that are kept.
"""

from __future__ import annotations

import marshal
import sys
from contextlib import suppress
from types import CodeType
from typing import Any

from ...files.cache import Cache
from .expressions import NUMBERS, numbers
from .fingerprint import fingerprint

EXPANSIONS = Cache("expansions")


def kept_expansion(function: Any, code: CodeType) -> CodeType:
    """Return what ``expanded_code`` does, from the cache or made now.

    It is named by all that machine code is named by, and by the lines that an error shows.

    Raises:
        EquationError: a statement cannot be rewritten.
    """
    made_by = f"python {sys.version} {sys.flags.optimize}"
    lines = f"{code.co_filename} {code.co_firstlineno} {code.co_linetable.hex()}"
    try:
        name = fingerprint(function, (), f"{made_by}; {lines}")
    except (OSError, TypeError, ValueError):
        return _made(function, code)
    kept = EXPANSIONS.load(name)
    if kept is not None:
        with suppress(EOFError, TypeError, ValueError):
            found: CodeType = marshal.loads(kept)
            if NUMBERS in _names(found):
                function.__globals__.setdefault(NUMBERS, numbers())
            return found
    made = _made(function, code)
    EXPANSIONS.save(name, marshal.dumps(made))
    return made


def _made(function: Any, code: CodeType) -> CodeType:
    # What rewrites code is imported where there is none that is kept.
    from .equations import expanded_code

    return expanded_code(function, code)


def _names(code: CodeType) -> set[str]:
    """All names that code looks up in its module, also in functions within."""
    inner = (each for each in code.co_consts if isinstance(each, CodeType))
    return set(code.co_names).union(*map(_names, inner))
