"""A world is built once for runs that differ by nothing in it, and each has a copy of its own."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from aloft.hal.simulated import mujoco_model
from aloft.hal.simulated.mujoco_model import build_world
from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.hal.simulated.variation import Variation
from aloft.robots.description import Hull, find_robot

ROBOT = find_robot("bruce")
FLAT = SimulatorParameters()


def bytes_of(model: mujoco.MjModel) -> bytes:
    buffer = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The robots that a model has been built of."""
    names: list[str] = []
    original = mujoco_model.build_mujoco_model

    def build(robot, **options):  # type: ignore[no-untyped-def]
        names.append(robot.name)
        return original(robot, **options)

    monkeypatch.setattr(mujoco_model, "build_mujoco_model", build)
    mujoco_model._model_cache.clear()
    return names


def test_the_same_world_is_a_copy_that_nobody_else_changes(built: list[str]) -> None:
    first = build_world(FLAT, ROBOT, Variation())
    expected = bytes_of(first)
    first.opt.timestep = 1.0
    second = build_world(FLAT.model_copy(update={"seed": 5}), ROBOT, Variation())
    assert built == ["bruce"]
    assert bytes_of(second) == expected
    second.geom_friction[:] = 0.0
    assert bytes_of(build_world(FLAT, ROBOT, Variation())) == expected


def test_what_is_in_the_model_makes_another_world(built: list[str]) -> None:
    usual = bytes_of(build_world(FLAT, ROBOT, Variation()))
    others = [
        build_world(FLAT, ROBOT, Variation(mass=1.1)),
        build_world(FLAT.model_copy(update={"timestep": 0.001}), ROBOT, Variation()),
        build_world(
            SimulatorParameters.model_validate({"ground": {"scene": "step"}}), ROBOT, Variation()
        ),
        build_world(FLAT, find_robot("bruce").model_copy(update={"name": "other"}), Variation()),
    ]
    assert built == ["bruce"] * 4 + ["other"]
    assert usual not in [bytes_of(model) for model in others]
    for k in range(9):
        build_world(FLAT, ROBOT, Variation(friction=0.5 + 0.01 * k))
    assert len(mujoco_model._model_cache) == 4, "older ones are forgotten"


def test_a_hull_is_a_mesh_where_its_corners_are() -> None:
    wedge = ((-0.1, 0.0), (0.1, 0.0), (0.03, 0.2))
    corners = [(x, y, z) for x, z in wedge for y in (-0.15, 0.1)]
    torso = ROBOT.link("torso").model_copy(update={"shapes": (Hull(corners=tuple(corners)),)})
    links = tuple(torso if link.name == "torso" else link for link in ROBOT.links)
    model = mujoco_model.build_mujoco_model(ROBOT.changed(links=links))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geom = model.geom("torso/0")
    assert geom.type == mujoco.mjtGeom.mjGEOM_MESH
    mesh = model.mesh(int(geom.dataid[0]))
    first, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
    vertices = model.mesh_vert[first : first + count]
    there, body = data.geom("torso/0"), data.body("torso")
    places = there.xpos + vertices @ there.xmat.reshape(3, 3).T
    local = (places - body.xpos) @ body.xmat.reshape(3, 3)
    np.testing.assert_allclose(sorted(local.tolist()), sorted(corners), atol=1e-6)
    plain = mujoco_model.build_mujoco_model(ROBOT)
    np.testing.assert_array_equal(model.body_mass, plain.body_mass)
    np.testing.assert_array_equal(model.body_inertia, plain.body_inertia)
