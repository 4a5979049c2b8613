"""The actuators of an MJCF file: what they give the joints that they drive, and those that push at a place.

An actuator may have several controls, such as position and velocity of a ``pid``, and several outputs, such as three
moments of an ``orientation``. Its controls begin at the row ``actuator_ctrladr`` of what MuJoCo keeps for each control,
its outputs at ``actuator_outadr`` of what it keeps for each output, gears among them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from .raw_model import RawThruster


def gear(model: Any, k: int) -> Array:
    """Return the gear (6,) of an actuator's first output."""
    return np.array(model.actuator_gear[model.actuator_outadr[k]])


def control_range(model: Any, k: int, which: int = 0) -> tuple[float, float] | None:
    """Return the range of one of an actuator's controls; ``None`` where it has none."""
    row = int(model.actuator_ctrladr[k]) + which
    if which >= int(model.actuator_ctrlnum[k]) or not model.actuator_ctrllimited[row]:
        return None
    lower, upper = model.actuator_ctrlrange[row].tolist()
    return lower, upper


def force_range(model: Any, k: int) -> tuple[float, float] | None:
    """Return the range of an actuator's force; ``None`` where it has none."""
    if not model.actuator_forcelimited[k]:
        return None
    lower, upper = model.actuator_forcerange[k].tolist()
    return lower, upper


def actuators_on(model: Any, j: int) -> list[int]:
    """Return the actuators that drive a joint."""
    import mujoco

    on_joint = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    return [
        k
        for k in range(model.nactuator)
        if int(model.actuator_trntype[k]) in on_joint and model.actuator_trnid[k][0] == j
    ]


def geared(model: Any, j: int, what: str) -> float:
    """Return the ``armature`` or ``damping`` of actuators, given at their side of the gear, at the joint."""
    values = getattr(model, f"actuator_{what}")
    return sum(float(values[k]) * float(gear(model, k)[0]) ** 2 for k in actuators_on(model, j))


def servo_speed(model: Any, j: int) -> float:
    """Return the largest speed [rad/s] that a servo on a joint is commanded to; NaN without one."""
    import mujoco

    found = math.nan
    for k in actuators_on(model, j):
        stiffness, damping = (float(value) for value in model.actuator_biasprm[k][1:3])
        affine = int(model.actuator_biastype[k]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
        if int(model.actuator_ctrlnum[k]) > 1:  # a position and a velocity
            limits, ratio = control_range(model, k, 1), 1.0
        elif affine and stiffness == 0.0 and damping < 0.0:
            limits = control_range(model, k)
            ratio = abs(float(model.actuator_gainprm[k][0]) / damping)
        else:
            continue
        if limits is not None:
            most = ratio * max(map(abs, limits))
            found = float(np.fmax(found, most / abs(float(gear(model, k)[0]) or 1.0)))
    return found


def motor_torque(model: Any, j: int) -> float:
    """Return the largest torque [N m] of the actuators on a joint; 0 without one, NaN if unlimited."""
    import mujoco

    found = 0.0
    for k in actuators_on(model, j):
        ratio = abs(float(gear(model, k)[0]))
        simple = (
            int(model.actuator_biastype[k]) == int(mujoco.mjtBias.mjBIAS_NONE)
            and int(model.actuator_gaintype[k]) == int(mujoco.mjtGain.mjGAIN_FIXED)
            and int(model.actuator_ctrlnum[k]) == 1
        )
        forces, controls = force_range(model, k), control_range(model, k)
        most = math.nan
        if simple and controls is not None:
            most = abs(float(model.actuator_gainprm[k][0])) * max(map(abs, controls))
        if forces is not None:
            most = float(np.fmin(most, max(map(abs, forces))))
        found += ratio * most
    if model.jnt_actfrclimited[j] and found != 0.0:
        return float(np.fmin(found, np.max(np.abs(model.jnt_actfrcrange[j]))))
    return found


def thrusters(model: Any, notes: list[str]) -> dict[str, RawThruster]:
    """Return the actuators on sites that push along a direction, with a moment about it."""
    import mujoco

    found = {}
    for k in range(model.nactuator):
        site, reference = (int(each) for each in model.actuator_trnid[k])
        if int(model.actuator_trntype[k]) != int(mujoco.mjtTrn.mjTRN_SITE):
            continue
        name = model.actuator(k).name or f"thruster_{k + 1}"
        gain = float(model.actuator_gainprm[k][0])
        along = gear(model, k) * gain
        force, moment = float(np.linalg.norm(along[:3])), along[3:]
        axis = along[:3] / (force or 1.0)
        ratio = float(moment @ axis) / (force or 1.0)
        forces, controls = force_range(model, k), control_range(model, k)
        why = ""
        if force == 0.0 or reference >= 0 or int(model.actuator_ctrlnum[k]) > 1:
            why = "it gives no force along a direction of its site"
        elif np.abs(moment - ratio * force * axis).max() > 1e-9 * force:
            why = "its moment is not about its force"
        elif int(model.actuator_biastype[k]) != int(mujoco.mjtBias.mjBIAS_NONE):
            why = "its force depends on more than its control"
        elif forces is not None:
            most = forces[1] * force / abs(gain)
        elif controls is not None:
            most = controls[1] * force
        else:
            why = "it has neither ctrlrange nor forcerange"
        if why:
            notes.append(f"actuator {name} is left out: {why}; write it under thrusters")
            continue
        filters = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
        lag = (
            float(model.actuator_dynprm[k][0]) if int(model.actuator_dyntype[k]) in filters else 0.0
        )
        if controls is not None and controls[0] < 0.0:
            notes.append(f"actuator {name} pushes both ways in the file, and only forwards here")
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.site_quat[site])
        body = model.body(int(model.site_bodyid[site])).name
        found[name] = RawThruster(
            body, np.array(model.site_pos[site]), turn.reshape(3, 3) @ axis, most, ratio, lag
        )
    return found
