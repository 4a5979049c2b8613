"""Reads a URDF or MJCF file with MuJoCo.

MuJoCo compiles the file, so it handles defaults, alternative orientations, included files and
degrees. Two things are taken out before: inertias, because MuJoCo refuses or changes impossible
ones of links that are fixed to others (published files have such), and meshes, because it reads
only few formats and needs none here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...files.problems import listing
from ...mathematics.arrays import Array
from . import capsules as fit
from .file_sensors import file_sensors, unknown_sensors
from .hulls import RawShape, of_points
from .left_out import left_out
from .left_out_urdf import left_out_of_urdf
from .looks import NOTHING_SEEN, RawLook, RawMesh, hex_color, urdf_looks
from .meshes import READABLE, mesh_triangles
from .package_files import find_file
from .raw_model import NOTHING, Inertial, RawBody, RawJoint, RawModel, RawThruster, full_tensor
from .urdf_text import UrdfJoint, XmlFile, check_urdf, urdf_joints
from .xacro_text import XACRO


class TakenMesh(NamedTuple):
    """A mesh that was taken out of the model: its name in the file, the file itself, if it is there,
    its ``scale`` (3,) and its ``color`` as ``#RRGGBB``, None where the file gives none."""

    written: str
    path: Path | None
    scale: Array
    color: str | None


def read_model(path: Path) -> RawModel:
    """Return the content of the file.

    Raises:
        RobotError: it is no URDF and no MJCF, or MuJoCo cannot make sense of it.
    """
    import mujoco

    file = XmlFile(path)
    if file.is_urdf:
        check_urdf(file)
    try:
        if path.suffix == XACRO:
            spec = mujoco.MjSpec.from_string(file.content)
        else:
            spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, RuntimeError) as error:
        raise file.error(f"MuJoCo cannot read this: {_one_line(error)}") from error
    notes: list[str] = []
    _name_everything(spec, file.is_urdf)
    _refuse_closed_loops(spec, file)
    inertials = _take_inertials(spec, file.is_urdf)
    meshes = _take_meshes(spec, path.parent, inertials, notes)
    try:
        model = spec.compile()
    except (ValueError, RuntimeError) as error:
        raise file.error(f"MuJoCo cannot compile this: {_one_line(error)}") from error
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    free, ball = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
    for k in range(model.njnt):
        kind, start = int(model.jnt_type[k]), int(model.jnt_qposadr[k])
        if kind in (free, ball):
            data.qpos[start + (3 if kind == free else 0)] = 1.0
    mujoco.mj_kinematics(model, data)
    limits = urdf_joints(file) if file.is_urdf else {}
    looks = urdf_looks(file) if file.is_urdf else {}
    mimics = tuple(name for name, joint in limits.items() if joint.mimics)
    for name in mimics:
        notes.append(f"joint {name} mimics {limits[name].mimics} in the URDF and is fixed here")
    still = tuple(name for name, joint in limits.items() if joint.range == "none")
    for name in still:
        notes.append(f"joint {name} has a range of 0 to 0 in the URDF and is fixed here")
    for name, joint in limits.items():
        if joint.range == "free":
            notes.append(
                f"joint {name} has no lower and upper limit in the URDF and turns freely here"
            )
    for name, joint in limits.items():
        for what, value in (("effort", joint.effort), ("velocity", joint.speed)):
            if value < 0.0:
                notes.append(
                    f"joint {name} has a negative {what} limit in the URDF, {value:g}: it counts as none"
                )
    if file.is_urdf:
        notes += left_out_of_urdf(file)
    else:
        tied = _tied_joints(spec)
        mimics += tuple(tied)
        for name, leader in tied.items():
            notes.append(f"joint {name} {leader} in the file and is fixed here")
        notes += left_out(model, spec)
    notes += unknown_sensors(model, file)
    names = [model.body(k).name for k in range(model.nbody)]
    bodies = {}
    for k in range(1, model.nbody):
        bodies[names[k]] = RawBody(
            names[k],
            names[model.body_parentid[k]],
            _tidy(data.xmat[k].reshape(3, 3)),
            np.array(data.xpos[k]),
            _inertial(model, k, inertials.get(names[k])),
            tuple(
                _joint(model, data, j, limits)
                for j in range(model.njnt)
                if model.jnt_bodyid[j] == k
            ),
            tuple(_shapes(model, k, meshes, notes)),
            looks.get(names[k], NOTHING_SEEN) if file.is_urdf else _look(model, k, meshes),
        )
    name = spec.modelname or path.stem
    pose, thrusters = _key_frame(model), _thrusters(model, notes)
    names_world = not file.is_urdf or file.has("link", names[0])
    return RawModel(
        name, path, file.is_urdf, bodies, names[0], names_world, pose, mimics + still,
        tuple(dict.fromkeys(notes)), thrusters, file_sensors(model, file),
    )  # fmt: skip


def _refuse_closed_loops(spec: Any, file: XmlFile) -> None:
    """Raise ``RobotError`` for MJCF whose bodies are tied together beside the tree of joints."""
    import mujoco

    kinds = {mujoco.mjtEq.mjEQ_CONNECT: "connect", mujoco.mjtEq.mjEQ_WELD: "weld"}
    loops = [
        f"{eq.name or kinds[eq.type]} ({eq.name1} and {eq.name2})"
        for eq in spec.equalities
        if eq.type in kinds
    ]
    if loops:
        raise file.error(
            f"the file closes loops, which a tree of links has not: {listing(loops)}",
            "no equality of the kinds connect and weld",
            listing(loops),
            "describe the mechanism by its transmission: transmission: {motors, joint_to_motor}",
        )


def _tied_joints(spec: Any) -> dict[str, str]:
    """Return the joints that an equality of MJCF ties to another one or to a value, and which."""
    import mujoco

    return {
        eq.name1: f"follows {eq.name2}" if eq.name2 else "is held"
        for eq in spec.equalities
        if eq.type == mujoco.mjtEq.mjEQ_JOINT and eq.active
    }


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _tidy(values: Array) -> Array:
    """Return directions without the rounding errors of angles such as 1.5707963: nearly straight ones are made
    straight.
    """
    values = np.array(values, dtype=float)
    nearest = np.round(values)
    return np.where(np.abs(values - nearest) < 1e-10, nearest, values) + 0.0


def _name_everything(spec: Any, is_urdf: bool) -> None:
    for k, body in enumerate(spec.bodies):
        body.name = body.name or f"body_{k}"
        for i, joint in enumerate(body.joints):
            joint.name = joint.name or f"{body.name}_joint" + (f"_{i + 1}" if i else "")
    for k, geom in enumerate(spec.geoms):
        # A URDF may call several shapes the same; of MJCF sensors and contact pairs name geoms.
        geom.name = f"geom/{k}" if is_urdf or not geom.name else geom.name


def _take_inertials(spec: Any, is_urdf: bool) -> dict[str, tuple[float, Array]]:
    """Take the inertials that the file gives out of the model: mass, tensor in the inertial frame.

    Every one is replaced by a unit body at its place, which any compiler accepts.
    """
    import mujoco

    spec.compiler.fusestatic = False
    if (
        not is_urdf
        and spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    ):
        return {}
    found = {}
    for body in spec.bodies[1:]:
        if not body.explicitinertial and not is_urdf and len(body.geoms):
            continue  # An MJCF body without an inertial has that of its shapes.
        if not body.explicitinertial:
            found[body.name] = (0.0, np.zeros((3, 3)))
            body.ipos = [0.0, 0.0, 0.0]
        elif math.isnan(body.fullinertia[0]):
            found[body.name] = (float(body.mass), np.diag(body.inertia))
        else:
            found[body.name] = (float(body.mass), full_tensor(np.array(body.fullinertia)))
        body.fullinertia = [math.nan, 0.0, 0.0, 0.0, 0.0, 0.0]
        body.mass, body.inertia, body.explicitinertial = 1.0, [1.0, 1.0, 1.0], True
    return found


def _take_meshes(
    spec: Any, folder: Path, inertials: dict[str, Any], notes: list[str]
) -> dict[str, TakenMesh]:
    """Take the meshes of bodies with an inertial out of the model, by geom."""
    import mujoco

    kinds = mujoco.mjtGeom
    found: dict[str, TakenMesh] = {}
    usual = np.array(mujoco.MjSpec().default.geom.rgba)
    materials = {each.name: each for each in spec.materials}
    files = {mesh.name: mesh for mesh in spec.meshes}
    base = folder / (spec.compiler.meshdir or "")
    needed: list[str] = []
    for geom in list(spec.geoms):
        material, rgba = materials.get(geom.material), np.array(geom.rgba)
        color = None if (rgba == usual).all() else hex_color(rgba)
        if color is None and material is not None and not any(material.textures):
            color = hex_color(np.array(material.rgba))
        geom.material = ""
        if geom.type not in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF):
            continue
        mesh = files.get(geom.meshname)
        if geom.parent.name not in inertials and geom.parent.name != "world":
            needed.append(geom.meshname)
        elif mesh is not None:
            path = find_file(mesh.file, base)
            found[geom.name] = TakenMesh(mesh.file, path, np.array(mesh.scale), color)
            geom.meshname, geom.type, geom.size = "", kinds.mjGEOM_SPHERE, [0.01, 0.0, 0.0]
    for mesh in list(spec.meshes):
        if mesh.name not in needed:
            spec.delete(mesh)
    for group in (spec.textures, spec.materials, spec.skins):
        for each in list(group):
            spec.delete(each)
    return found


def _inertial(model: Any, k: int, taken: tuple[float, Array] | None) -> Inertial:
    import mujoco

    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[k])
    rotation, position = _tidy(turn.reshape(3, 3)), np.array(model.body_ipos[k])
    mass, tensor = taken or (float(model.body_mass[k]), np.diag(model.body_inertia[k]))
    if mass == 0.0 and not np.any(tensor):
        return NOTHING
    return Inertial(mass, np.zeros(3), tensor).moved(rotation, position)


def _joint(model: Any, data: Any, j: int, urdf: dict[str, UrdfJoint]) -> RawJoint:
    import mujoco

    kinds = {
        int(mujoco.mjtJoint.mjJNT_HINGE): "hinge",
        int(mujoco.mjtJoint.mjJNT_SLIDE): "slide",
        int(mujoco.mjtJoint.mjJNT_FREE): "free",
        int(mujoco.mjtJoint.mjJNT_BALL): "ball",
    }
    name, dof = model.joint(j).name, int(model.jnt_dofadr[j])
    lower, upper = (float(value) for value in model.jnt_range[j])
    effort, speed = _motor_torque(model, j), _servo_speed(model, j)
    rotor, drag = _geared(model, j, "armature"), _geared(model, j, "damping")
    free = False
    if name in urdf:
        effort, speed = urdf[name].effort, urdf[name].speed
        free = urdf[name].range in ("free", "none")
    return RawJoint(
        name,
        kinds[int(model.jnt_type[j])],
        _tidy(data.xaxis[j]),
        np.array(data.xanchor[j]),
        (lower, upper) if model.jnt_limited[j] and not free else None,
        effort,
        speed,
        float(model.dof_armature[dof]) + rotor,
        float(np.max(model.dof_damping[dof])) + drag,
        float(model.dof_frictionloss[dof]),
    )


def _actuators_on(model: Any, j: int) -> list[int]:
    """Return the MJCF actuators that drive a joint."""
    import mujoco

    on_joint = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    return [
        k
        for k in range(model.nactuator)
        if int(model.actuator_trntype[k]) in on_joint and model.actuator_trnid[k][0] == j
    ]


def _geared(model: Any, j: int, what: str) -> float:
    """Return the ``armature`` or ``damping`` of actuators, given at their side of the gear, at the joint."""
    values = getattr(model, f"actuator_{what}")
    return sum(
        float(values[k]) * float(model.actuator_gear[k][0]) ** 2 for k in _actuators_on(model, j)
    )


def _servo_speed(model: Any, j: int) -> float:
    """Return the largest speed [rad/s] that a velocity servo on a joint is commanded to; NaN without one."""
    import mujoco

    found = math.nan
    for k in _actuators_on(model, j):
        stiffness, damping = (float(value) for value in model.actuator_biasprm[k][1:3])
        servo = (
            int(model.actuator_biastype[k]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
            and stiffness == 0.0
            and damping < 0.0
        )
        if servo and model.actuator_ctrllimited[k]:
            ratio = abs(float(model.actuator_gainprm[k][0]) / damping)
            most = ratio * float(np.max(np.abs(model.actuator_ctrlrange[k])))
            found = float(np.fmax(found, most / abs(float(model.actuator_gear[k][0]) or 1.0)))
    return found


def _motor_torque(model: Any, j: int) -> float:
    """Return the largest torque [N m] of the MJCF actuators on a joint; 0 without one, NaN if unlimited."""
    import mujoco

    found = 0.0
    for k in _actuators_on(model, j):
        gear, gain = abs(float(model.actuator_gear[k][0])), abs(float(model.actuator_gainprm[k][0]))
        is_motor = int(model.actuator_biastype[k]) == int(mujoco.mjtBias.mjBIAS_NONE)
        if model.actuator_forcelimited[k]:
            torque = gear * float(np.max(np.abs(model.actuator_forcerange[k])))
        elif is_motor and model.actuator_ctrllimited[k]:
            torque = gear * gain * float(np.max(np.abs(model.actuator_ctrlrange[k])))
        else:
            torque = math.nan
        found += torque
    if model.jnt_actfrclimited[j] and found != 0.0:
        return float(np.fmin(found, np.max(np.abs(model.jnt_actfrcrange[j]))))
    return found


def _thrusters(model: Any, notes: list[str]) -> dict[str, RawThruster]:
    """Return the MJCF actuators on sites that push along a direction, with a moment about it."""
    import mujoco

    found = {}
    for k in range(model.nactuator):
        site, reference = (int(each) for each in model.actuator_trnid[k])
        if int(model.actuator_trntype[k]) != int(mujoco.mjtTrn.mjTRN_SITE):
            continue
        name = model.actuator(k).name or f"thruster_{k + 1}"
        gear = np.array(model.actuator_gear[k]) * float(model.actuator_gainprm[k][0])
        force, moment = float(np.linalg.norm(gear[:3])), gear[3:]
        axis = gear[:3] / (force or 1.0)
        ratio = float(moment @ axis) / (force or 1.0)
        why = ""
        if force == 0.0 or reference >= 0:
            why = "it gives no force along a direction of its site"
        elif np.abs(moment - ratio * force * axis).max() > 1e-9 * force:
            why = "its moment is not about its force"
        elif int(model.actuator_biastype[k]) != int(mujoco.mjtBias.mjBIAS_NONE):
            why = "its force depends on more than its control"
        elif model.actuator_forcelimited[k]:
            most = (
                float(model.actuator_forcerange[k][1]) * force / abs(model.actuator_gainprm[k][0])
            )
        elif model.actuator_ctrllimited[k]:
            most = float(model.actuator_ctrlrange[k][1]) * force
        else:
            why = "it has neither ctrlrange nor forcerange"
        if why:
            notes.append(f"actuator {name} is left out: {why}; write it under thrusters")
            continue
        filters = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
        lag = (
            float(model.actuator_dynprm[k][0]) if int(model.actuator_dyntype[k]) in filters else 0.0
        )
        if model.actuator_ctrllimited[k] and model.actuator_ctrlrange[k][0] < 0.0:
            notes.append(f"actuator {name} pushes both ways in the file, and only forwards here")
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.site_quat[site])
        body = model.body(int(model.site_bodyid[site])).name
        found[name] = RawThruster(
            body, np.array(model.site_pos[site]), turn.reshape(3, 3) @ axis, most, ratio, lag
        )
    return found


def _shapes(model: Any, k: int, meshes: dict[str, TakenMesh], notes: list[str]) -> list[RawShape]:
    """Return the shapes of a body, in its own frame; shapes that touch nothing are left out."""
    import mujoco

    kinds = mujoco.mjtGeom
    of_kind: dict[int, Callable[[Array], list[fit.Capsule]]] = {
        int(kinds.mjGEOM_SPHERE): lambda size: fit.of_sphere(float(size[0])),
        int(kinds.mjGEOM_CAPSULE): lambda size: [fit.along(2, float(size[1]), float(size[0]))],
        int(kinds.mjGEOM_CYLINDER): lambda size: fit.of_cylinder(float(size[0]), float(size[1])),
        int(kinds.mjGEOM_BOX): fit.of_box,
        int(kinds.mjGEOM_ELLIPSOID): fit.of_ellipsoid,
    }
    found: list[RawShape] = []
    for g in range(model.ngeom):
        if model.geom_bodyid[g] != k or not (model.geom_contype[g] or model.geom_conaffinity[g]):
            continue
        name, body = model.geom(g).name, model.body(k).name
        kind, size = int(model.geom_type[g]), np.array(model.geom_size[g])
        shapes: Sequence[RawShape] = ()
        if name in meshes:
            written, path, scale, _ = meshes[name]
            if path is None:
                notes.append(f"link {body}: the mesh {written} is not there, so it has no shape")
            elif path.suffix.lower() not in READABLE:
                notes.append(
                    f"link {body}: the mesh {written} is of a format that is not read "
                    f"({', '.join(READABLE)} are), so it has no shape"
                )
            else:
                try:
                    shapes = of_points(mesh_triangles(path).reshape(-1, 3) * scale)
                except (ValueError, OSError) as error:
                    notes.append(f"link {body}: {_one_line(error)}, so it has no shape")
        elif kind == int(kinds.mjGEOM_MESH):
            mesh = int(model.geom_dataid[g])
            start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            shapes = of_points(np.array(model.mesh_vert[start : start + count], dtype=float))
        elif kind in of_kind:
            shapes = of_kind[kind](size)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[g])
        rotation, position = turn.reshape(3, 3), np.array(model.geom_pos[g])
        found += [shape.moved(rotation, position) for shape in shapes]
    return found


def _look(model: Any, k: int, meshes: dict[str, TakenMesh]) -> RawLook:
    """Return the meshes that an MJCF body is drawn as: those that touch nothing, if it has such."""
    import mujoco

    found: dict[bool, list[RawMesh]] = {True: [], False: []}
    for g in range(model.ngeom):
        name = model.geom(g).name
        if model.geom_bodyid[g] != k or name not in meshes:
            continue
        written, path, scale, color = meshes[name]
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[g])
        file = written if path is None else str(path.resolve())
        touches = bool(model.geom_contype[g] or model.geom_conaffinity[g])
        mesh = RawMesh(file, turn.reshape(3, 3), np.array(model.geom_pos[g]), scale, color)
        found[touches].append(mesh)
    return RawLook(found[False] or found[True])


def _key_frame(model: Any) -> dict[str, float]:
    """Return the joint angles of the key frame called home or stand, else of the first."""
    import mujoco

    names = [model.key(k).name for k in range(model.nkey)]
    if not names:
        return {}
    key = next((names.index(name) for name in ("home", "stand", "standing") if name in names), 0)
    simple = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    return {
        model.joint(j).name: float(model.key_qpos[key][model.jnt_qposadr[j]])
        for j in range(model.njnt)
        if int(model.jnt_type[j]) in simple
    }
