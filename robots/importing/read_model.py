"""Reads a URDF or MJCF file with MuJoCo.

MuJoCo compiles the file, so it handles defaults, alternative orientations, included files and
degrees. Two things are taken out before: inertias, because MuJoCo refuses or changes impossible
ones of links that are fixed to others (``inertials``), and meshes, because it reads
only few formats and needs none here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...files.problems import listing
from ...mathematics.arrays import Array
from . import capsules as fit
from .actuators import geared, motor_torque, servo_speed, thrusters
from .file_sensors import file_sensors, unknown_sensors
from .hulls import RawShape, of_points
from .inertials import (
    chosen,
    compile_reference,
    impossible_parts,
    mujoco_remarks,
    one_line,
    replace_inertials,
    tidy_directions,
    unset_compiler,
    written_inertials,
)
from .left_out import left_out
from .left_out_urdf import left_out_of_urdf
from .looks import NOTHING_SEEN, RawLook, RawMesh, hex_color, urdf_looks
from .meshes import READABLE, mesh_triangles
from .package_files import find_file
from .raw_model import RawBody, RawJoint, RawModel
from .ties import held_positions, tie_notes, ties_of_mjcf, ties_of_urdf
from .urdf_text import UrdfJoint, XmlFile, check_urdf, urdf_joints
from .urdf_words import limited_by_degrees
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

    file = XmlFile(path)
    if file.is_urdf:
        check_urdf(file)
    notes, remarks = list[str](), list[str]()
    if file.hangs_from_world:
        notes.append(
            "a joint hangs from the link world, which the URDF does not declare: it is the ground, as in Drake"
        )
    with mujoco_remarks(remarks):
        spec, untouched = _parsed(file), _parsed(file)
    _refuse_closed_loops(spec, file)
    _refuse_inner_free_joints(spec, file)
    written = written_inertials(spec, file.is_urdf)
    replace_inertials(spec, written)
    meshes = _take_meshes(spec, path.parent, written)
    _take_meshes(untouched, path.parent, written)
    if written:
        unset_compiler(spec)
    try:
        with mujoco_remarks(remarks):
            bare = spec.compile()
    except (ValueError, RuntimeError) as error:
        raise file.error(f"MuJoCo cannot compile this: {one_line(error)}") from error
    with mujoco_remarks(remarks):
        reference = compile_reference(untouched, written, file.is_urdf)
    # What the compiler derives from inertia, such as damping from a damping ratio, is right in the reference only.
    model = bare if reference.model is None else reference.model
    limits = urdf_joints(file) if file.is_urdf else {}
    looks = urdf_looks(file) if file.is_urdf else {}
    pose = _key_frame(spec, model)
    ties = ties_of_urdf(limits) if file.is_urdf else ties_of_mjcf(spec, model)
    ranges = {
        model.joint(j).name: (float(model.jnt_range[j][0]), float(model.jnt_range[j][1]))
        for j in range(model.njnt)
        if model.jnt_limited[j]
    }
    held = held_positions(ties, pose, ranges)
    data = _placed(model, held)
    notes += tie_notes(ties, held, file.is_urdf)
    for name, joint in limits.items():
        if joint.range == "free":
            notes.append(
                f"joint {name} has no lower and upper limit in the URDF and turns freely here"
            )
        if joint.half is not None:
            notes.append(
                f"joint {name} has one limit in the URDF; the other is zero, as in the format: {joint.half[0]:g} to {joint.half[1]:g}"
            )
    for name, joint in limits.items():
        for what, value in (("effort", joint.effort), ("velocity", joint.speed)):
            if value < 0.0:
                notes.append(
                    f"joint {name} has a negative {what} limit in the URDF, {value:g}: it counts as none"
                )
    if file.is_urdf:
        notes += filter(None, map(limited_by_degrees, file.root.findall("joint")))
    notes += left_out_of_urdf(file) if file.is_urdf else left_out(model, spec)
    notes += unknown_sensors(model, file)
    if not file.is_urdf:  # what it passes over in a URDF is read above
        notes += [f"MuJoCo says of the file: {said}" for said in remarks]
    names = [model.body(k).name for k in range(model.nbody)]
    bodies, changed = {}, []
    for k in range(1, model.nbody):
        inertial, is_changed = chosen(bare, k, written.get(names[k]), reference)
        if is_changed:
            changed.append(names[k])
        bodies[names[k]] = RawBody(
            names[k],
            names[model.body_parentid[k]],
            tidy_directions(data.xmat[k].reshape(3, 3)),
            np.array(data.xpos[k]),
            inertial,
            tuple(
                _joint(model, data, j, limits)
                for j in range(model.njnt)
                if model.jnt_bodyid[j] == k
            ),
            tuple(_shapes(model, k, meshes, notes)),
            looks.get(names[k], NOTHING_SEEN) if file.is_urdf else _look(model, k, meshes),
        )
    if changed:
        notes.append(
            f"masses and inertias of {listing(changed, 4)} are those that MuJoCo's compiler sets, not the written ones"
        )
    if file.is_urdf and (weightless := _weightless(file, bare)):
        notes.append(
            f"links {listing(weightless, 4)} have shapes for collisions and no <inertial>: they weigh nothing here, and MuJoCo would "
            "weigh the shapes"
        )
    if odd := impossible_parts(bare, written):
        notes.append(
            f"inertias of {listing(odd, 4)}, which no joint moves, are none that a body has; they count as they are written"
        )
    name = spec.modelname or path.stem
    pushing = thrusters(model, notes)
    names_world = not file.is_urdf or file.has("link", names[0])
    return RawModel(
        name, path, file.is_urdf, bodies, names[0], names_world, pose, held,
        tuple(dict.fromkeys(notes)), pushing, file_sensors(model, file),
        bool(changed) or not written, reference,
    )  # fmt: skip


def _parsed(file: XmlFile) -> Any:
    """Return the file as MuJoCo reads it, with a name for everything."""
    import mujoco

    try:
        if file.path.suffix == XACRO or file.hangs_from_world:
            spec = mujoco.MjSpec.from_string(file.content)
        else:
            spec = mujoco.MjSpec.from_file(str(file.path))
    except (ValueError, RuntimeError) as error:
        raise file.error(f"MuJoCo cannot read this: {one_line(error)}") from error
    spec.compiler.fusestatic = False
    _name_everything(spec, file.is_urdf)
    return spec


def _weightless(file: XmlFile, model: Any) -> list[str]:
    """Return the links of a URDF that touch things, are fixed to others and have no inertia."""
    names = [
        link.get("name", "")
        for link in file.root.findall("link")
        if link.find("inertial") is None and link.find("collision") is not None
    ]
    bodies = [(name, model.body(name)) for name in names]
    return [name for name, body in bodies if body.parentid[0] and not body.jntnum[0]]


def _placed(model: Any, held: Mapping[str, float]) -> Any:
    """Return the model's data with all joints at zero, but those that are held where they are held."""
    import mujoco

    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    free, ball = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
    for k in range(model.njnt):
        kind, start = int(model.jnt_type[k]), int(model.jnt_qposadr[k])
        if kind in (free, ball):
            data.qpos[start + (3 if kind == free else 0)] = 1.0
        else:
            data.qpos[start] = held.get(model.joint(k).name, 0.0)
    mujoco.mj_kinematics(model, data)
    return data


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


def _refuse_inner_free_joints(spec: Any, file: XmlFile) -> None:
    """Raise ``RobotError`` where a body moves freely on another one."""
    import mujoco

    inner = [
        (joint.name, body.name, body.parent.name)
        for body in spec.bodies[1:]
        for joint in body.joints
        if joint.type == mujoco.mjtJoint.mjJNT_FREE and body.parent.name != "world"
    ]
    if not inner:
        return
    what = [f"{name} of {body} on {parent}" for name, body, parent in inner]
    fix = (
        f'<link name="world"/> as the parent of {inner[0][0]} in place of {inner[0][2]}, or no {inner[0][2]} at all: a URDF\'s '
        "robot floats by itself"
        if file.is_urdf
        else f"{inner[0][1]} in <worldbody> itself"
    )
    raise file.error(
        f"a floating joint holds a body to another body: {listing(what)}",
        "floating joints on the world only", listing(what), fix,
    )  # fmt: skip


def _name_everything(spec: Any, is_urdf: bool) -> None:
    for k, body in enumerate(spec.bodies):
        body.name = body.name or f"body_{k}"
        for i, joint in enumerate(body.joints):
            joint.name = joint.name or f"{body.name}_joint" + (f"_{i + 1}" if i else "")
    for k, geom in enumerate(spec.geoms):
        # A URDF may call several shapes the same; of MJCF sensors and contact pairs name geoms.
        geom.name = f"geom/{k}" if is_urdf or not geom.name else geom.name


def _take_meshes(spec: Any, folder: Path, inertials: Mapping[str, Any]) -> dict[str, TakenMesh]:
    """Take the meshes of bodies with an inertial out of the model, by geom, and all that is only seen."""
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
    for each in (*spec.sites, *spec.tendons):
        each.material = ""
    for group in (spec.textures, spec.materials, spec.skins):
        for each in list(group):
            spec.delete(each)
    return found


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
    effort, speed = motor_torque(model, j), servo_speed(model, j)
    rotor, drag = geared(model, j, "armature"), geared(model, j, "damping")
    free, half = False, None
    if name in urdf:
        effort, speed = urdf[name].effort, urdf[name].speed
        free, half = urdf[name].range in ("free", "none"), urdf[name].half
    return RawJoint(
        name,
        kinds[int(model.jnt_type[j])],
        tidy_directions(data.xaxis[j]),
        np.array(data.xanchor[j]),
        (lower, upper) if model.jnt_limited[j] and not free else half,
        effort,
        speed,
        float(model.dof_armature[dof]) + rotor,
        float(np.max(model.dof_damping[dof])) + drag,
        float(model.dof_frictionloss[dof]),
    )


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
                    notes.append(f"link {body}: {one_line(error)}, so it has no shape")
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


def _key_frame(spec: Any, model: Any) -> dict[str, float]:
    """Return the joint positions of the key frame called home or stand, else of the first; empty where no frame gives
    any, as one that ``nkey`` only leaves room for.
    """
    import mujoco

    given = [k for k, key in enumerate(spec.keys) if len(key.qpos) and not np.isnan(key.qpos[0])]
    if not given:
        return {}
    names = {model.key(k).name: k for k in reversed(given)}
    key = next((names[name] for name in ("home", "stand", "standing") if name in names), given[0])
    simple = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    return {
        model.joint(j).name: float(model.key_qpos[key][model.jnt_qposadr[j]])
        for j in range(model.njnt)
        if int(model.jnt_type[j]) in simple
    }
