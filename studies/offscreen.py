"""Pictures of the simulated robot without a screen: MuJoCo's renderer on EGL.

Needs PyOpenGL (the extra ``pictures``) and, on Linux, a driver for OpenGL without a
screen; Mesa's does it on the processor: ``apt-get install libegl1 libgl1-mesa-dri``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from ..hal.simulated.mujoco_model import body_name, mujoco_spec
from ..mathematics.arrays import Array
from ..robots.surfaces import normals, robot_surfaces
from ..robots.terrain import Terrain
from ..runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ..robots.description import RobotDescription


Pixels = NDArray[np.uint8]

REMEDY = (
    "install the extra pictures and, on Linux, apt-get install libegl1 libgl1-mesa-dri; "
    "nothing can be drawn without"
)
PAINT = {
    "torso": (0.20, 0.36, 0.58), "hip": (0.33, 0.36, 0.40), "thigh": (0.87, 0.55, 0.20),
    "calf": (0.42, 0.46, 0.52), "foot": (0.16, 0.17, 0.19),
}  # fmt: skip
FORCE = (0.80, 0.15, 0.20, 1.0)
"""The colour of a force."""
ARROWS = 100
"""Largest number of forces that can be drawn."""
BLOCK, BONE = (0.78, 0.74, 0.66), (0.33, 0.36, 0.40)


class NoRendererError(AloftError):
    """Raised if nothing can be drawn without a screen."""


@dataclass(frozen=True)
class View:
    """The camera's target [m, world], its distance [m] and its direction [deg]."""

    look_at: tuple[float, float, float]
    distance: float
    azimuth: float = 112.0
    elevation: float = -9.0


class Offscreen:
    """Draws a robot in a scene. It is a context manager that holds the renderer.

    Raises:
        NoRendererError: the libraries for it are missing; the text says which to install.
    """

    def __init__(self, robot: RobotDescription, scene: Terrain, width: int, height: int) -> None:
        import mujoco

        self._gl = _context(width, height)
        self._model = _painted(robot, scene, width, height)
        self._data = mujoco.MjData(self._model)
        self._scene = mujoco.MjvScene(self._model, maxgeom=2 * self._model.ngeom + ARROWS)
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        self._option.sitegroup[:] = 0
        self._option.flags[mujoco.mjtVisFlag.mjVIS_TENDON] = 0
        try:
            self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except mujoco.FatalError as error:
            self._gl.free()
            raise NoRendererError(f"MuJoCo cannot draw here: {error}; {REMEDY}") from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._area = mujoco.MjrRect(0, 0, width, height)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._context.free()
        self._gl.free()

    def picture(
        self, base: Array, quaternion: Array, joints: Array, view: View,
        arrows: Iterable[tuple[Array, Array]] = (),
    ) -> Pixels:  # fmt: skip
        """Draw the robot in a pose (quaternion x, y, z, w), (height, width, 3).

        ``arrows`` are drawn from a first to a second point [m, world]. A robot whose base is fixed
        has joints only.
        """
        import mujoco

        data, camera = self._data, self._camera
        if self._model.nq > len(joints):
            data.qpos[:3] = base
            data.qpos[3], data.qpos[4:7] = quaternion[3], quaternion[:3]
        data.qpos[self._model.nq - len(joints) :] = joints
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)
        camera.lookat[:] = view.look_at
        camera.distance, camera.azimuth = view.distance, view.azimuth
        camera.elevation = view.elevation
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, camera, mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )
        for start, end in arrows:
            if self._scene.ngeom == self._scene.maxgeom:
                break
            geom = self._scene.geoms[self._scene.ngeom]
            kind = mujoco.mjtGeom.mjGEOM_ARROW
            mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), np.array(FORCE))
            mujoco.mjv_connector(geom, kind, 0.006 * view.distance, start, end)
            self._scene.ngeom += 1
        mujoco.mjr_render(self._area, self._scene, self._context)
        pixels = np.zeros((self._area.height, self._area.width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._area, self._context)
        return np.flipud(pixels)


def _context(width: int, height: int) -> Any:
    """Make a new OpenGL context current, and return it."""
    try:
        if sys.platform == "linux":
            from mujoco.egl import GLContext
        elif sys.platform == "darwin":
            from mujoco.cgl import GLContext
        else:
            from mujoco.glfw import GLContext
        context = GLContext(width, height)
        context.make_current()
    except Exception as error:  # whatever a missing or broken driver raises
        raise NoRendererError(f"no OpenGL without a screen ({error}); {REMEDY}") from error
    return context


def _painted(robot: RobotDescription, scene: Terrain, width: int, height: int) -> Any:
    """Return the simulator's own model with a floor pattern, lights, the surfaces of links, and
    colours and bones of those without."""
    import mujoco

    spec = mujoco_spec(robot, scene=scene)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.quality.shadowsize = 3072
    spec.stat.extent, spec.stat.center = 1.5, [0.2, 0.0, 0.2]  # what the shadows have to cover
    spec.visual.map.shadowclip = 4.0  # less leaves black dots on the floor behind
    spec.visual.headlight.ambient = [0.45, 0.45, 0.45]
    spec.visual.headlight.diffuse = [0.25, 0.25, 0.25]
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=32, height=32,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, rgb1=[0.97, 0.98, 1.0], rgb2=[0.90, 0.93, 0.97],
    )  # fmt: skip
    spec.add_texture(
        name="tiles", type=mujoco.mjtTexture.mjTEXTURE_2D, width=256, height=256,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER, rgb1=[0.80, 0.83, 0.87],
        rgb2=[0.88, 0.90, 0.93],
    )  # fmt: skip
    tiles = spec.add_material(name="tiles", texrepeat=[10, 10], texuniform=True)
    tiles.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[0.35, 0.45, -1.0], pos=[-1.0, -1.0, 3.0],
        diffuse=[0.6, 0.6, 0.6], castshadow=True,
    )  # fmt: skip
    for geom in spec.geoms:
        if geom.name == "floor":
            geom.material = "tiles"
        elif geom.name.startswith(("box/", "field/")):
            geom.rgba = [*BLOCK, 1.0]
        else:
            part = next((c for p, c in PAINT.items() if p in geom.name), PAINT["foot"])
            geom.rgba = [*part, 1.0]
    drawn = robot_surfaces(robot).links
    for link, parts in drawn.items():
        for geom in spec.body(body_name(link)).geoms:
            geom.rgba = [0.0, 0.0, 0.0, 0.0]
        for k, surface in enumerate(parts):
            name = f"look/{link}/{k}"
            spec.add_mesh(
                name=name, uservert=surface.corners.ravel(), userface=surface.triangles.ravel(),
                usernormal=normals(surface).ravel(), userfacenormal=surface.triangles.ravel(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
            )  # fmt: skip
            color = (
                BONE
                if surface.color is None
                else [b / 255.0 for b in surface.color.to_bytes(3, "big")]
            )
            spec.body(body_name(link)).add_geom(
                type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, mass=0.0, contype=0, conaffinity=0,
                rgba=[*color, 1.0],
            )  # fmt: skip
    for joint in robot.joints:
        if joint.parent not in drawn and max(abs(x) for x in joint.origin) > 0.0:
            spec.body(joint.parent).add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[0.012, 0, 0], mass=0.0, contype=0,
                conaffinity=0, fromto=[0.0, 0.0, 0.0, *joint.origin], rgba=[*BONE, 1.0],
            )  # fmt: skip
    return spec.compile()
