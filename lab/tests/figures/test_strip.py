"""Frames without a screen; skipped where there is no OpenGL for it."""

import numpy as np
import pytest

from aloft.hal.simulated.scenes import step
from aloft.lab.figures.strip import Moment, Motion, draw_strip, moments_of
from aloft.robots.description import find_robot
from aloft.robots.terrain import Terrain
from aloft.studies import offscreen
from aloft.studies.offscreen import NoRendererError, Offscreen, View

ROBOT = find_robot("bruce")
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
VIEW = View((0.0, 0.0, 0.3), 1.2)


def blue(picture: np.ndarray) -> np.ndarray:
    """Where the chest and the caps of joints are: no other thing has that colour."""
    red, green, azure = np.moveaxis(picture.astype(int), -1, 0)
    return (azure > red + 60) & (azure > green + 25)


def test_the_robot_is_where_its_pose_says() -> None:
    joints = ROBOT.standing_position
    try:
        with Offscreen(ROBOT, step(0.05, 0.1), 120, 160) as renderer:
            low, high = (
                renderer.picture(np.array([0.0, 0.0, z]), UPRIGHT, joints, VIEW) for z in (0.4, 0.6)
            )
            again = renderer.picture(np.array([0.0, 0.0, 0.4]), UPRIGHT, joints, VIEW)
    except NoRendererError as error:
        pytest.skip(str(error))
    assert low.shape == (160, 120, 3)
    assert np.array_equal(low, again)
    rows = [np.nonzero(blue(picture))[0].mean() for picture in (low, high)]
    assert 0.005 < blue(low).mean() < 0.2
    assert rows[0] - rows[1] > 10  # higher up is nearer to the picture's first row


@pytest.mark.long
def test_the_robot_is_drawn_on_ground_of_many_pieces() -> None:
    (piece,) = step(0.05, 0.1).blocks
    ground = Terrain(blocks=(piece,) * 400)
    try:
        with Offscreen(ROBOT, ground, 120, 160) as renderer:
            pose = np.array([0.0, 0.0, 0.4]), UPRIGHT, ROBOT.standing_position
            picture = renderer.picture(*pose, VIEW)
    except NoRendererError as error:
        pytest.skip(str(error))
    assert blue(picture).mean() > 0.005


def test_a_strip_has_a_frame_for_every_moment() -> None:
    n = 5
    base = np.array([[0.0, 0.0, 0.4]] * n)
    motion = Motion(
        np.linspace(0.0, 1.0, n), base, np.array([UPRIGHT] * n), np.zeros((n, len(ROBOT.joints)))
    )
    moments = [Moment(0.0, "0 s"), Moment(0.5, "0.5 s"), Moment(1.0, "1 s")]
    try:
        picture = draw_strip("t", ["n"], motion, moments, ROBOT, step(0.05, 0.1), VIEW, columns=2)
    except NoRendererError as error:
        pytest.skip(str(error))
    found = blue(np.asarray(picture))
    half_x, half_y = found.shape[1] // 2, found.shape[0] // 2
    quarters = [found[:half_y, :half_x], found[:half_y, half_x:], found[half_y:, :half_x]]
    assert all(quarter.mean() > 0.002 for quarter in quarters)
    assert found[half_y:, half_x:].mean() < 0.0005


def test_moments_follow_the_jump() -> None:
    moments = moments_of(0.4, 1.0, 1.3, 2.9)
    times = [moment.time for moment in moments]
    assert times == sorted(times) and {0.4, 1.0, 1.3, 2.9} <= set(times)
    assert moments[2].text == "1.00 s  lift-off" and moments[5].text == "1.30 s  touchdown"


def test_where_nothing_draws_the_error_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(offscreen.sys, "platform", "linux")
    monkeypatch.setitem(__import__("sys").modules, "mujoco.egl", None)
    with pytest.raises(NoRendererError, match=r"no OpenGL .* apt-get install libegl1 libgl1-mesa"):
        Offscreen(ROBOT, step(0.05, 0.1), 16, 16)
