"""The surface of the ground is the one that the simulator collides with."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from aloft.hal.simulated.mujoco_model import build_mujoco_model
from aloft.robots.description import find_robot
from aloft.robots.terrain import Ground, HeightField, Terrain

HEIGHTS = tuple(map(tuple, (0.1 * np.random.default_rng(1).random((6, 9))).tolist()))
TERRAIN = Terrain(
    -0.2,
    (
        Ground((0.0, 0.0, -0.1), (1.0, 1.0, 0.1), (0.2, -0.1), friction=0.5),
        Ground((1.0, 0.0, -0.1), (1.5, 1.0, 0.12), (0.0, 0.3)),
        Ground((0.5, -1.0, -0.2), (1.0, -0.2, 0.05)),
    ),
    (HeightField((-1.0, -1.0), (0.0, 0.0), HEIGHTS, friction=0.6),),
)


@pytest.fixture(scope="module")
def world():
    model = build_mujoco_model(find_robot("bruce"), scene=TERRAIN)
    data = mujoco.MjData(model)
    data.qpos[2] = 100.0  # out of the way of the rays
    mujoco.mj_forward(model, data)
    return model, data


def test_heights_are_those_that_the_simulator_finds(world):
    model, data = world
    rng, geom = np.random.default_rng(0), np.zeros(1, np.int32)
    normal = np.zeros(3)
    for x, y in rng.uniform((-1.2, -1.2), (1.7, 1.2), (1000, 2)).tolist():
        place, down = np.array([x, y, 5.0]), np.array([0.0, 0.0, -1.0])
        found = 5.0 - mujoco.mj_ray(model, data, place, down, None, 1, -1, geom, normal)
        assert TERRAIN.height(x, y) == pytest.approx(found, abs=1e-7)
        np.testing.assert_allclose(TERRAIN.normal(x, y), normal, atol=1e-6)


def test_the_highest_piece_decides_about_friction():
    assert TERRAIN.friction(0.5, 0.5) == 0.5
    assert TERRAIN.friction(1.2, 0.5) is None
    assert TERRAIN.friction(-0.5, -0.5) == 0.6
    assert TERRAIN.friction(5.0, 5.0) is None


def test_friction_and_stiffness_are_those_of_the_piece(world):
    model, _ = world
    assert model.geom("box/0").friction[0] == 0.5 and model.geom("field/0").friction[0] == 0.6
    assert model.geom("box/0").priority == 2 and model.geom("box/1").priority == 0


def test_pictures_have_the_corners_of_a_field():
    corners, triangles = TERRAIN.fields[0].triangles()
    assert len(corners) == 54 and len(triangles) == 2 * 5 * 8
    x, y, z = corners[10]
    assert TERRAIN.height(x, y) == pytest.approx(z)
