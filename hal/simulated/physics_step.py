"""The simulator's physics step as calls that machine code makes, too."""

from __future__ import annotations

import ctypes
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from ...mathematics.compiling.foreign_call import ForeignCall, address_of

if TYPE_CHECKING:
    from mujoco import MjData, MjModel


def step_calls(model: MjModel, data: MjData) -> tuple[ForeignCall, ForeignCall]:
    """Return the two parts of a physics step: what follows from the state, and the step with the present controls. ``model``
    and ``data`` must stay alive.

    Machine code and Python call the same two functions, so the bytes are the same. An error that is fatal to the
    simulator, such as no memory left for contacts, ends the process in machine code, and is an exception in Python.
    Of the simulator's memory a jump uses less than a hundredth.
    """
    import mujoco

    first, second = _addresses()
    memory = model._address, data._address
    return (
        ForeignCall(partial(mujoco.mj_step1, model, data), first, *memory),
        ForeignCall(partial(mujoco.mj_step2, model, data), second, *memory),
    )


@cache
def _addresses() -> tuple[int, int]:
    """Of ``mj_step1`` and ``mj_step2`` in the library that Python has loaded; zeros where it is not found."""
    import mujoco

    folder, version = Path(mujoco.__file__).parent, mujoco.mj_versionString()
    for name in (f"libmujoco.so.{version}", f"libmujoco.{version}.dylib"):
        if (folder / name).is_file():
            library = ctypes.CDLL(str(folder / name))
            return address_of(library.mj_step1), address_of(library.mj_step2)
    return 0, 0
