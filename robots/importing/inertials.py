"""Mass and inertia of the bodies of a file, and MuJoCo's own compile of it with them.

MuJoCo refuses or changes impossible inertias of links that are fixed to others, which published files have, so the
importer compiles the file with stand-ins and keeps what is written. The reference is compiled with what is written: what
the compiler sets (``settotalmass``, ``boundmass``, ``boundinertia``, ``balanceinertia``, ``inertiafromgeom``) is in it,
and its numbers count wherever they are not the written ones.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ..kinematics import inertia_tensor
from .raw_model import NOTHING, Inertial, Reference

LIGHT = 1e-13
"""Mass [kg] and inertia [kg m^2] of a stand-in for a body that MuJoCo refuses, too little to change a robot."""
SAME = 1e-9
"""Share by which a compiled mass or inertia may differ from the written one, which has all its digits."""

Written = dict[str, tuple[float, Array]]


def one_line(error: Exception) -> str:
    """Return the text of an error of MuJoCo in one line."""
    return " ".join(str(error).split())


def tidy_directions(values: Array) -> Array:
    """Return directions without the rounding errors of angles such as 1.5707963: nearly straight ones are made
    straight.
    """
    values = np.array(values, dtype=float)
    nearest = np.round(values)
    return np.where(np.abs(values - nearest) < 1e-10, nearest, values) + 0.0


def written_inertials(spec: Any, is_urdf: bool) -> Written:
    """Return the inertials that the file gives: mass and tensor in the inertial frame, by body.

    A body of MJCF without one has that of its shapes, as has every body of ``inertiafromgeom="true"``; a link of a URDF
    without one has none.
    """
    import mujoco

    if spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        return {}
    found: Written = {}
    for body in spec.bodies[1:]:
        if not body.explicitinertial:
            if is_urdf or not len(body.geoms):
                found[body.name] = (0.0, np.zeros((3, 3)))
        elif math.isnan(body.fullinertia[0]):
            found[body.name] = (float(body.mass), np.diag(body.inertia))
        else:
            found[body.name] = (float(body.mass), inertia_tensor(body.fullinertia))
    return found


def replace_inertials(spec: Any, written: Collection[str], size: float = 1.0) -> None:
    """Put a body of ``size`` [kg, kg m^2] in the place of each of these, which any compiler accepts."""
    for body in spec.bodies[1:]:
        if body.name in written:
            if not body.explicitinertial:
                body.ipos = [0.0, 0.0, 0.0]
            body.fullinertia = [math.nan, 0.0, 0.0, 0.0, 0.0, 0.0]
            body.mass, body.inertia, body.explicitinertial = size, [size] * 3, True


def unset_compiler(spec: Any) -> None:
    """Let the compiler change no mass and no inertia, as stand-ins are in place of them."""
    spec.compiler.settotalmass = -1.0
    spec.compiler.boundmass = spec.compiler.boundinertia = 0.0
    spec.compiler.balanceinertia = False


@contextmanager
def mujoco_remarks(found: list[str]) -> Iterator[None]:
    """Append what MuJoCo remarks meanwhile to ``found``, each once. By default it prints it, and writes a log file into the
    current folder.
    """
    import mujoco

    before = mujoco.get_mju_user_warning()
    said: list[str] = []
    mujoco.set_mju_user_warning(said.append)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield
    finally:
        mujoco.set_mju_user_warning(before)
    for each in (*said, *(str(warning.message) for warning in caught)):
        text = " ".join(each.split())
        if text not in found:
            found.append(text)


def compile_reference(spec: Any, written: Written, is_urdf: bool) -> Reference:
    """Compile the file with its own inertials. Where MuJoCo refuses it, bodies that no compiler accepts are replaced."""
    spec.compiler.fusestatic = False
    massless = [name for name, (mass, _) in written.items() if is_urdf and mass == 0.0]
    # MuJoCo weighs the shapes of a link without an inertial, which in a URDF has no mass.
    replace_inertials(spec, massless, LIGHT)
    model, why = _compiled(spec)
    if model is not None:
        return Reference(spec, model, "", tuple(massless))
    impossible = [
        name for name, (mass, tensor) in written.items()
        if name not in massless and not _is_possible(mass, tensor)
    ]  # fmt: skip
    replace_inertials(spec, impossible, LIGHT)
    model, why_still = _compiled(spec)
    refused = why if model is not None else why_still
    return Reference(spec, model, refused, (*massless, *impossible))


def _compiled(spec: Any) -> tuple[Any, str]:
    """Return the compiled model, or ``None`` and why not."""
    try:
        return spec.compile(), ""
    except (ValueError, RuntimeError) as error:
        return None, one_line(error)


def _is_possible(mass: float, tensor: Array) -> bool:
    """Check whether MuJoCo takes a mass and an inertia for those of a body that moves."""
    if not (math.isfinite(mass) and np.isfinite(tensor).all()):
        return False
    least, middle, most = np.linalg.eigvalsh(tensor)
    return bool(mass > 1e-14 and least > 1e-14 and least + middle >= most)


ROUNDED = 1e-2
"""Share by which principal moments of published files are wrong through rounding."""
SMALL = 1e-5
"""kg m^2; smaller moments of a part, such as the ones of a frame that many files have, change no robot."""


def impossible_parts(model: Any, written: Written) -> list[str]:
    """Return the bodies that no joint moves and whose inertia no body has, such as one moment above the sum of the
    others. No rule of descriptions finds them, as the body that they are part of may well have its inertia."""
    found = []
    for name, (_, tensor) in written.items():
        if model.body(name).jntnum[0] or not np.any(tensor):
            continue
        least, middle, most = np.linalg.eigvalsh(tensor)
        wrong = least < -ROUNDED * most or most > (1.0 + ROUNDED) * (least + middle)
        if wrong and most > SMALL:
            found.append(name)
    return found


def body_inertial(model: Any, k: int, written: tuple[float, Array] | None) -> Inertial:
    """Return a body of a compiled model in its own frame; ``written`` takes the place of mass and tensor."""
    import mujoco

    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[k])
    rotation, position = tidy_directions(turn.reshape(3, 3)), np.array(model.body_ipos[k])
    mass, tensor = written or (float(model.body_mass[k]), np.diag(model.body_inertia[k]))
    if mass == 0.0 and not np.any(tensor):
        return NOTHING
    return Inertial(mass, np.zeros(3), tensor).moved(rotation, position)


def chosen(
    model: Any, k: int, written: tuple[float, Array] | None, reference: Reference
) -> tuple[Inertial, bool]:
    """Return a body as it is written, or, where MuJoCo's compile of the file has another, that one, and whether it is.

    Args:
        model: compiled with stand-ins.
        k: the body's number, the same in both models.
        written: its mass and tensor in the file, if the file gives any.
        reference: MuJoCo's own compile.
    """
    ours = body_inertial(model, k, written)
    if reference.model is None or model.body(k).name in reference.stand_ins:
        return ours, False
    theirs = body_inertial(reference.model, k, None)
    large = max(float(np.abs(ours.inertia).max()), float(np.abs(theirs.inertia).max()))
    same = (
        abs(ours.mass - theirs.mass) <= SAME * max(ours.mass, theirs.mass)
        and float(np.abs(ours.com - theirs.com).max()) <= SAME
        and float(np.abs(ours.inertia - theirs.inertia).max()) <= SAME * large
    )
    return (ours, False) if same else (theirs, True)
