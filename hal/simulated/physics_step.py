"""The simulator's physics step as calls that machine code makes, too.

MuJoCo's integrators of one stage do not conserve momentum: a robot in the air that swings its legs gains some, of first order
in the step. BRUCE's centre of mass gains 10 mm/s in 0.4 s at 0.5 ms (``docs/ground.md``). So steps that begin without any contact can be
made by Runge and Kutta's method, which gains a millionth of that for three evaluations more; with contacts it has no advantage,
as forces of contacts jump. In such a step contacts do not act, as with one stage: the blow of a touchdown in a later stage would change
the velocity unseen by the accelerometer, which shows the beginning of the step.
"""

from __future__ import annotations

import ctypes
from copy import copy
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Indices
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.foreign_call import ForeignCall, address_of
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel

if TYPE_CHECKING:
    from mujoco import MjData, MjModel


STAGES = 4
"""Of Runge and Kutta's method."""


def step_calls(model: MjModel, data: MjData) -> tuple[ForeignCall, ForeignCall]:
    """Return the two parts of a physics step: what follows from the state, and the step with the present controls. ``model``
    and ``data`` must stay alive.

    Machine code and Python call the same two functions, so the bytes are the same. An error that is fatal to the
    simulator, such as no memory left for contacts, ends the process in machine code, and is an exception in Python.
    Of the simulator's memory a jump uses less than a hundredth.
    """
    import mujoco

    memory = model._address, data._address
    return (
        ForeignCall(partial(mujoco.mj_step1, model, data), _address("mj_step1"), *memory),
        ForeignCall(partial(mujoco.mj_step2, model, data), _address("mj_step2"), *memory),
    )


class JointResistance(NamedTuple):
    """The resistance of each degree of freedom, which may change while a model is simulated."""

    friction: Array
    damping: Array


@kernel
def begin_flight_step(
    contacts: Array, of_ground: JointResistance, of_flight: JointResistance, flight: Indices,
    ground: Indices,
) -> None:  # fmt: skip
    """Choose the integrator by the number of ``contacts``, and bring the model of the flight up to date."""
    if contacts[0] == 0.0:
        flight[0], ground[0] = 1, 0
        of_flight.friction[:] = of_ground.friction
        of_flight.damping[:] = of_ground.damping
    else:
        flight[0], ground[0] = 0, 1


def flight_step_calls(model: MjModel, data: MjData, second: ForeignCall) -> list[Call]:
    """Return the calls that take the place of the ``second`` part of a physics step: the same, or Runge and Kutta's method
    where no contact acts."""
    import mujoco

    flight, ground = np.zeros(1, np.int64), np.ones(1, np.int64)
    second.when = ground
    memory = model._address, data._address
    # Without mj_rnePostConstraint accelerometers keep the body accelerations of an earlier step.
    names = (
        "mj_fwdActuation", "mj_fwdAcceleration", "mj_fwdConstraint", "mj_rnePostConstraint", "mj_sensorAcc", "mj_checkAcc",
    )  # fmt: skip
    calls = [
        ForeignCall(partial(getattr(mujoco, name), model, data), _address(name), *memory)
        for name in names
    ]
    airborne = copy(model)
    airborne.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    stages = partial(mujoco.mj_RungeKutta, airborne, data, STAGES)
    address = _address("mj_RungeKutta")
    calls.append(ForeignCall(stages, address, airborne._address, data._address, STAGES))
    for call in calls:
        call.when = flight
    contacts = data.sensor("contacts").data
    of_ground, of_flight = (
        JointResistance(each.dof_frictionloss, each.dof_damping) for each in (model, airborne)
    )
    begin = KernelCall(begin_flight_step, contacts, of_ground, of_flight, flight, ground)
    return [begin, second, *calls]


def _address(name: str) -> int:
    library = _library()
    return 0 if library is None else address_of(getattr(library, name))


@cache
def _library() -> ctypes.CDLL | None:
    """Return the library that Python has loaded; ``None`` where it is not found."""
    import mujoco

    folder, version = Path(mujoco.__file__).parent, mujoco.mj_versionString()
    for name in (f"libmujoco.so.{version}", f"libmujoco.{version}.dylib"):
        if (folder / name).is_file():
            return ctypes.CDLL(str(folder / name))
    return None
