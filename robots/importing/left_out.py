"""Content of an MJCF file that a description has no place for, one sentence each, with where it may be written instead.
``left_out_urdf`` does the same for URDFs.

A description holds what a robot is. Friction and softness of contacts belong to the simulated ground, gains to the
controller, and gravity to the world: what a file says of them is reported and not taken over. What is as MuJoCo
has it by default is no statement of the file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ...files.problems import listing
from ...mathematics.constants import GRAVITY
from .actuators import control_range, force_range, gear

FRICTION = (1.0, 0.005, 0.0001)
"""Sliding, torsional and rolling friction where a file gives none."""
SOLREF, SOLIMP = (0.02, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0)
"""Softness of contacts where a file gives none: time constant [s] and damping ratio, and the impedance."""
MOST = 4
"""Names that a sentence lists."""


def left_out(model: Any, spec: Any) -> Iterator[str]:
    """Yield the sentences for a compiled MJCF model and what it was compiled from."""
    yield from _contacts(model)
    yield from _joints(model)
    yield from _servos(model)
    yield from _sensors(model)
    yield from _tied(model, spec)
    yield from _medium(model)


def _contacts(model: Any) -> Iterator[str]:
    """Yield the contact parameters of what touches, by value."""
    touching = [
        g for g in range(model.ngeom)
        if model.geom_bodyid[g] and (model.geom_contype[g] or model.geom_conaffinity[g])
    ]  # fmt: skip
    bodies = [model.body(int(model.geom_bodyid[g])).name for g in touching]

    def given(values: Any, usual: Iterable[float]) -> str:
        rows = [_numbers(values[g]) for g in touching]
        return by_value(rows, bodies, _numbers(tuple(usual)))

    slide = given(model.geom_friction[:, :1], FRICTION[:1])
    if slide:
        yield (
            f"left out: friction coefficient {slide}; friction is the ground's, robot.ground.friction in a "
            "graph or trial"
        )
    twist = given(model.geom_friction[:, 1:], FRICTION[1:])
    condim = given(model.geom_condim[:, None], (3.0,))
    if twist or condim:
        both = " and ".join(
            text for text in (twist and f"torsional and rolling friction {twist}", condim and f"condim {condim}")
            if text
        )  # fmt: skip
        yield f"left out: {both}; contacts here have normal force and sliding friction, condim 3"
    solref, solimp = given(model.geom_solref, SOLREF), given(model.geom_solimp, SOLIMP)
    if solref:
        yield (
            f"left out: softness of contacts, solref {solref}; robot.ground.soles in a graph or "
            "trial makes soles soft"
        )
    if solimp:
        yield f"left out: impedance of contacts, solimp {solimp}; it is the simulator's own for all"
    for values, called, instead in (
        (model.geom_margin[:, None], "contact margin", "contacts begin where shapes touch"),
        (model.geom_gap[:, None], "contact gap", "contacts begin where shapes touch"),
        (model.geom_adhesion[:, None], "adhesion", "contacts here only push"),
        (model.geom_surfacevel, "surface velocity", "surfaces here stand still on their links"),
    ):
        found = given(values, (0.0,) * values.shape[1])
        if found:
            yield f"left out: {called} {found}; {instead}"


def _joints(model: Any) -> Iterator[str]:
    """Yield the springs and damping that grows with speed."""
    names = [model.joint(j).name for j in range(model.njnt)]
    stiffness = np.concatenate([model.jnt_stiffness[:, None], model.jnt_stiffnesspoly], axis=1)
    rests = [float(model.qpos_spring[int(model.jnt_qposadr[j])]) for j in range(model.njnt)]
    rows = [_spring(each, rest) for each, rest in zip(stiffness, rests, strict=True)]
    springs = by_value(rows, names, "")
    if springs:
        yield f"left out: springs of joints, stiffness {springs} N m/rad; joints here have none"
    yields = by_value([f"{value:g}" for value in model.jnt_springyield], names, "0")
    if yields:
        yield f"left out: that springs of joints yield, at {yields}; joints here have none"
    poly = [_numbers(model.dof_dampingpoly[int(model.jnt_dofadr[j])]) for j in range(model.njnt)]
    growing = by_value(poly, names, _numbers(np.zeros(model.dof_dampingpoly.shape[1])))
    if growing:
        yield f"left out: damping that grows with speed, coefficients {growing}; that of low speed stays"
    held = [model.body(k).name for k in range(model.nbody) if model.body_gravcomp[k]]
    if held:
        yield f"left out: gravcomp of {listing(held, MOST)}; gravity acts on all links"


def _spring(stiffness: Any, rest: float) -> str:
    """Return the stiffness of a spring, the coefficients of its growth with the deflection if it grows, and where it is at
    rest if not at zero; empty where there is none."""
    if not np.any(stiffness):
        return ""
    last = int(np.flatnonzero(stiffness)[-1])
    return _numbers(stiffness[: last + 1]) + (f" about {rest:g}" if rest else "")


def _servos(model: Any) -> Iterator[str]:
    """Yield the gains of servos, dynamics of actuators, and actuators that move no single joint."""
    import mujoco

    kinds, bias, dyn = mujoco.mjtTrn, mujoco.mjtBias, mujoco.mjtDyn
    rows, joints, slow, others, curved, one_way = [], [], [], [], [], []
    for k in range(model.nactuator):
        kind = int(model.actuator_trntype[k])
        if kind == int(kinds.mjTRN_SITE):
            continue  # thrusters, of which read_model tells
        target = int(model.actuator_trnid[k][0])
        if kind not in (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)):
            others.append(model.actuator(k).name or f"number {k + 1}")
            continue
        name = model.joint(target).name
        if int(model.actuator_biastype[k]) == int(bias.mjBIAS_AFFINE):
            _, stiffness, damping = (0.0 - float(value) for value in model.actuator_biasprm[k][:3])
            ratio = float(gear(model, k)[0]) ** 2
            rows.append(f"kp {ratio * stiffness:g}, kv {ratio * damping:g}")
            joints.append(name)
        elif int(model.actuator_biastype[k]) != int(bias.mjBIAS_NONE):
            curved.append(name)
        if int(model.actuator_dyntype[k]) != int(dyn.mjDYN_NONE):
            slow.append(name)
        one_way += [f"{text} ({name})" for text in _one_way(model, k)]
    gains = by_value(rows, joints, "")
    if gains:
        yield (
            f"left out: gains of servos, {gains} at the joint; gains follow from inertia and motor, and "
            "joint_pd.flight_stiffness in a graph sets them"
        )
    if curved:
        yield f"left out: how the torque of actuators on {listing(curved, MOST)} depends on their motion"
    if slow:
        yield f"left out: activation dynamics of the actuators on {listing(slow, MOST)}; motors here give their torque at once"
    if one_way:
        yield f"left out: that torques differ by direction, {listing(one_way, MOST)}; the larger counts for both here"
    delays = by_value(
        [f"{value:g} s" for value in model.actuator_delay], _actuator_names(model), "0 s"
    )
    if delays:
        yield f"left out: delay of actuators, {delays}; robot.latency in a graph or trial delays commands"
    kept = by_value(
        [f"{int(row[0])}" for row in model.actuator_history], _actuator_names(model), "0"
    )
    if kept:
        yield f"left out: nsample of actuators, {kept}; robot.latency in a graph or trial delays commands"
    if others:
        yield f"left out: actuators {listing(others, MOST)}, which drive no single joint; write them as transmission"


def _actuator_names(model: Any) -> list[str]:
    return [model.actuator(k).name or f"number {k + 1}" for k in range(model.nactuator)]


def _one_way(model: Any, k: int) -> Iterator[str]:
    """Yield the range of an actuator's force or control that is not the same in both directions."""
    import mujoco

    force, control = force_range(model, k), control_range(model, k)
    limits: tuple[float, float] | None = None  # a servo's control is where it goes
    if force is not None:
        limits = force
    elif int(model.actuator_biastype[k]) == int(mujoco.mjtBias.mjBIAS_NONE):
        limits = control
    if limits is not None and abs(limits[0] + limits[1]) > 1e-9 * max(map(abs, limits)):
        yield f"{limits[0]:g} to {limits[1]:g}"


def _sensors(model: Any) -> Iterator[str]:
    """Yield what sensors do besides measuring, and what they have with the other sign."""
    import mujoco

    names = [model.sensor(k).name or f"number {k + 1}" for k in range(model.nsensor)]
    for values, called, unit in (
        (model.sensor_delay, "delay", " s"),
        (model.sensor_interval[:, :1].ravel(), "interval", " s"),
        (model.sensor_cutoff, "cutoff", ""),
        (model.sensor_history[:, :1].ravel(), "nsample", ""),
    ):
        rows = [f"{float(value):g}{unit}" for value in values]
        found = by_value(rows, names, f"0{unit}")
        if found:
            yield (
                f"left out: {called} of sensors, {found}; noise of a sensor in the description has delay, range and "
                "resolution"
            )
    kinds = (int(mujoco.mjtSensor.mjSENS_FORCE), int(mujoco.mjtSensor.mjSENS_TORQUE))
    turned = [
        name for name, kind in zip(names, model.sensor_type.tolist(), strict=True) if kind in kinds
    ]
    if turned:
        yield (
            f"sensors {listing(turned, MOST)} have the other sign here: MuJoCo gives what the carrying link does to the sensor's, "
            "force_torque what the ground does to it"
        )


def _medium(model: Any) -> Iterator[str]:
    """Yield what surrounds the robot: another gravity, and a medium that drags."""
    import mujoco

    gravity = f"gravity is {GRAVITY:g} m/s^2 downwards"
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
        yield f"left out: that gravity is off; {gravity}"
    elif abs(float(np.linalg.norm(model.opt.gravity)) - GRAVITY) > 0.02:
        yield f"left out: a gravity of {_numbers(model.opt.gravity)} m/s^2; {gravity}"
    if model.opt.density or model.opt.viscosity:
        wind = f", wind {_numbers(model.opt.wind)} m/s" if np.any(model.opt.wind) else ""
        yield (
            f"left out: a medium of density {model.opt.density:g} kg/m^3 and viscosity {model.opt.viscosity:g} Pa s{wind}; "
            "nothing drags links here"
        )


def _tied(model: Any, spec: Any) -> Iterator[str]:
    """Yield sentences on what ties or sets apart bodies and joints beside the tree."""
    import mujoco

    if model.ntendon:
        names = [model.tendon(k).name or f"number {k + 1}" for k in range(model.ntendon)]
        yield f"left out: tendons {listing(names, MOST)}"
    known = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_JOINT)
    ties = [eq.name or f"of {eq.name1}" for eq in spec.equalities if eq.type not in known]
    if ties:
        yield f"left out: equalities {listing(ties, MOST)}"
    if len(spec.pairs):
        yield f"left out: {len(spec.pairs)} contact pairs with parameters of their own"
    if len(spec.excludes):
        pairs = [f"{each.bodyname1} and {each.bodyname2}" for each in spec.excludes]
        yield (
            f"left out: that {listing(pairs, MOST)} do not touch; what overlaps in the standing pose, and links of "
            "one limb, do not here"
        )
    if model.nflex:
        yield f"left out: {model.nflex} deformable bodies"


def by_value(rows: list[str], names: list[str], usual: str) -> str:
    """Return each value that is not the usual one, with the names that have it; empty where all are usual."""
    found: dict[str, dict[str, None]] = {}
    for row, name in zip(rows, names, strict=True):
        if row != usual:
            found.setdefault(row, {})[name] = None
    return "; ".join(f"{row} ({listing([*owners], MOST)})" for row, owners in found.items())


def _numbers(values: Any) -> str:
    return " ".join(f"{float(value):g}" for value in values)
