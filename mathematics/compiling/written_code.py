"""Machine code of functions that are written in LLVM's language here, because kernels cannot do what
they do: call functions by their addresses."""

from __future__ import annotations

import hashlib
from typing import Any

from . import store
from .machine_code import MachineCode, assemble, tools

_alive: list[MachineCode] = []


def written_code(module: Any) -> MachineCode:
    """The function ``ENTRY`` of a module, from the cache or made now. It stays in memory."""
    text = str(module)
    name = hashlib.blake2b(f"{tools()}|{text}".encode(), digest_size=16).hexdigest()
    kept = store.load(name)
    if kept is None:
        kept = assemble(text)
        store.save(name, kept)
    code = MachineCode(kept)
    _alive.append(code)
    return code
