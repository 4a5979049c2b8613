"""Scenes of stairs, fields and tiles, and ground that is uneven without anyone being told."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PIL import Image
from pydantic import ValidationError

from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.hal.simulated.scenes import SceneParameters, step
from aloft.hal.simulated.tiles import UnevenParameters
from aloft.robots.description import find_robot
from aloft.robots.kinematics import ball_feet, standing_contacts
from aloft.runtime.language.context import Context

from ...compiled import heights_and_normals

BRUCE = find_robot("bruce")


def scene(**values):
    return SceneParameters.model_validate(values).build(3)


def test_boxes_may_lean_with_units():
    ground = scene(boxes=[{"x": ["20 cm", "40 cm"], "top": "3 cm", "slope": ["5 deg", 0]}])
    assert ground.height(0.3, 0.0) == pytest.approx(0.03)
    assert ground.height(0.39, 0.0) == pytest.approx(0.03 + 0.09 * math.tan(math.radians(5)))
    assert ground.normal(0.3, 0.0)[0] == pytest.approx(-math.sin(math.radians(5)))
    assert ground.uneven == pytest.approx(0.1 * math.tan(math.radians(5)))


def test_stairs_lead_up_and_down():
    up = scene(stairs=[{"x": 0.1, "rise": 0.02, "run": 0.2, "steps": 3}])
    assert [round(up.height(x, 0.0), 6) for x in (0.0, 0.2, 0.4, 0.6)] == [0.0, 0.02, 0.04, 0.06]
    down = scene(floor=-0.1, stairs=[{"x": 0.1, "rise": -0.03, "run": 0.2, "steps": 2}])
    assert [round(down.height(x, 0.0), 6) for x in (0.2, 0.4, 2.0)] == [-0.03, -0.06, -0.1]
    assert up.uneven == 0.0, "a task can tell of stairs"


def test_fields_are_arrays_pictures_rubble_or_waves(tmp_path):
    area = {"x": [0.1, 0.5], "y": [-0.2, 0.2]}
    given = scene(fields=[{**area, "heights": [[0, 0], ["1 cm", 0.03]]}])
    assert given.height(0.5, 0.2) == pytest.approx(0.03)
    assert given.height(0.3, -0.2) == pytest.approx(0.0)
    Image.fromarray(np.array([[0, 255], [51, 0]], np.uint8)).save(tmp_path / "a.png")
    drawn = scene(fields=[{**area, "picture": str(tmp_path / "a.png"), "height": 0.1}])
    assert drawn.height(0.1, -0.2) == pytest.approx(0.02), "the lower left pixel"
    assert drawn.height(0.5, 0.2) == pytest.approx(0.1)
    rubble = scene(fields=[{**area, "rubble": 0.05, "height": 0.02}])
    assert rubble == scene(fields=[{**area, "rubble": 0.05, "height": 0.02}])
    assert 0.0 <= rubble.fields[0].lowest < rubble.fields[0].highest <= 0.02
    waves = scene(fields=[{**area, "waves": 0.2, "height": 0.02}])
    assert waves.height(0.3, 0.0) == pytest.approx(0.02, abs=2e-3)


@pytest.mark.parametrize(
    "values, complaint",
    [
        ({"fields": [{"x": [0, 1]}]}, "needs one of heights, picture, rubble, waves; given: none"),
        ({"fields": [{"x": [0, 1], "picture": "no.png"}]}, "no.png cannot be read"),
        ({"fields": [{"x": [0, 1], "heights": [[0, -0.02], [0, 0]]}]}, r"set floor: -0.03 m"),
        ({"fields": [{"x": [0, 1], "heights": [[0, 1], [0]]}]}, "as many numbers"),
        ({"boxes": [{"x": [0, 1], "top": 0.1, "slope": [1, 0]}]}, "not by 57 deg"),
        ({"tiles": [{"x": [1, 0], "top": 0}]}, "tiles must have an extent along x"),
        ({"tiles": [{"x": [0, 1], "top": 0, "size": [0.2, 0.1]}]}, "in rising order"),
    ],
)
def test_errors_say_what_is_wrong(values, complaint):
    with pytest.raises(ValidationError, match=complaint):
        scene(**values)


def test_tiles_stay_within_their_bounds():
    kind = UnevenParameters(reach=0.6)
    under = kind.cover(step(0.05, 0.2), BRUCE, 7)
    rng, steep = np.random.default_rng(0), 0
    places = rng.uniform(-0.59, 0.59, (400, 2))
    for x, height, normal in zip(places[:, 0], *heights_and_normals(under, places), strict=True):
        if abs(x - 0.2) < 0.005:
            continue  # the sides of leaning tiles lean, too
        level = 0.05 if x > 0.2 else 0.0
        assert abs(height - level) <= 0.01 + 1e-3
        steep += normal[2] < math.cos(math.radians(5.01))
    assert steep < 4, "only lines that meet the side of a leaning tile"
    tiles = [block for block in under.blocks if block.friction is not None]
    sizes = [block.most[k] - block.least[k] for block in tiles if not block.level for k in (0, 1)]
    assert max(sizes) < 0.25
    assert all(0.4 <= tile.friction <= 1.0 for tile in tiles)
    assert under != kind.cover(step(0.05, 0.2), BRUCE, 8)
    assert under == kind.cover(step(0.05, 0.2), BRUCE, 7)


@pytest.mark.parametrize("name", ["bruce", "go2", "solo12"])
def test_the_robot_stands_on_a_level_tile_at_the_start(name):
    robot = find_robot(name)
    kind = UnevenParameters()
    under = kind.cover(scene(), robot, 1)
    assert all(under.height(x, y) == 0.0 for x, y, _ in standing_contacts(robot).tolist())
    for ball in ball_feet(robot):  # no tile beside it is as high as the ball's surface there
        x, y, _ = standing_contacts(robot)[ball.point].tolist()
        ways = np.linspace(0.0, 0.999 * ball.radius, 20)
        sides = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
        around = (np.array([x, y]) + ways[:, None, None] * sides).reshape(-1, 2)
        highest = heights_and_normals(under, around)[0].reshape(-1, 4).max(axis=1)
        assert (highest <= ball.radius - np.sqrt(ball.radius**2 - ways**2)).all()


def test_the_simulator_tells_scores_how_uneven_its_ground_is():
    context = Context.__new__(Context)
    object.__setattr__(context, "robot", BRUCE)
    for uneven, tolerance in ((None, 0.0), ({"height": "2 cm"}, 0.02)):
        params = SimulatorParameters.model_validate({"ground": {"uneven": uneven}})
        assert MujocoRobot.exported_values(params, context)["ground_tolerance"] == tolerance
