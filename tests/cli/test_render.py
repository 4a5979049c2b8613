"""``aloft render``: films and pictures of recordings; skipped where there is no OpenGL without a screen."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aloft import load
from aloft.logs.file.reader import read
from aloft.logs.recording.recorder import Recorder
from aloft.logs.viewing.contacts import force_scale
from aloft.robots.description import find_robot
from aloft.runtime.language.errors import AloftError
from aloft.studies.film import Camera, Take, extent, instants
from aloft.studies.offscreen import NoRendererError, Offscreen

from .conftest import run_for_json, run_here

ROOT = Path(__file__).parents[2]
SMALL = ("--width", "120", "--height", "100")


@pytest.fixture(scope="module")
def pushed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first 0.5 s of the push, in which the robot stands."""
    path = tmp_path_factory.mktemp("render") / "pushed.rrd"
    graph = load(ROOT / "graphs" / "push.yaml", ["duration=0.5 s"])
    graph.run(sinks=[Recorder(path)], log=False)
    return path


@pytest.fixture(scope="module")
def renderer(pushed: Path) -> None:
    robot = read(pushed).header.robot
    assert robot is not None
    try:
        with Offscreen(robot, Take(read(pushed), "", Camera()).terrain, 16, 16):
            pass
    except NoRendererError as error:
        pytest.skip(str(error))


@pytest.mark.long
def test_a_film_has_a_picture_for_each_step_of_time(
    pushed: Path, renderer: None, tmp_path: Path
) -> None:
    film = tmp_path / "film.gif"
    words = ("--from", "0.1", "--to", "0.2", "--speed", "0.5", "--rate", "10", *SMALL)
    found = run_for_json("render", str(pushed), "-o", str(film), *words)
    assert found == {"success": True, "file": str(film), "pictures": 3}
    with Image.open(film) as image:
        assert (image.size, image.info["duration"]) == ((120, 122), 100)
        assert 1 < image.n_frames <= 3, "equal pictures are one that stays longer"
    again = tmp_path / "again.gif"
    run_for_json("render", str(pushed), "-o", str(again), *words)
    assert film.read_bytes() == again.read_bytes()


@pytest.mark.parametrize(
    "words", [["render"], ["plot", "a.b"], ["view", "--out", "x.rrd", "--no-show"]]
)
def test_a_recording_that_is_not_there_is_one_line(words: list[str], tmp_path: Path) -> None:
    file = tmp_path / "n.rrd"
    done = run_here(words[0], str(file), *words[1:], code=2)
    assert str(file) in done.stderr.replace("\n", "") and "Traceback" not in done.stderr
    assert "there is no" in done.stderr


@pytest.mark.long
def test_several_runs_stand_side_by_side(pushed: Path, renderer: None, tmp_path: Path) -> None:
    one, two = tmp_path / "one.png", tmp_path / "two.png"
    run_here("render", str(pushed), "-o", str(one), "--at", "0.3", *SMALL, "--caption", "a")
    run_here("render", *[str(pushed)] * 2, "-o", str(two), "--at", "0.3", *SMALL,
             "--caption", "a", "--caption", "a")  # fmt: skip
    alone, both = (np.asarray(Image.open(path)) for path in (one, two))
    assert np.array_equal(both, np.concatenate([alone, alone], axis=1))
    bare = tmp_path / "bare.png"
    run_here("render", str(pushed), "-o", str(bare), "--at", "0.3", *SMALL, "--caption", "a",
             "--no-forces")  # fmt: skip
    red = [
        int(((p[..., 0] > 120) & (p[..., 1] < 60) & (p[..., 2] < 80)).sum())
        for p in (alone, np.asarray(Image.open(bare)))
    ]
    assert red[0] > 2 and red[1] == 0, "the forces on the feet"


@pytest.mark.long
def test_several_runs_in_one_picture(pushed: Path, renderer: None, tmp_path: Path) -> None:
    one, two = tmp_path / "one.png", tmp_path / "two.png"
    words = ("--at", "0.3", *SMALL, "--no-forces", "--caption", "a")
    run_here("render", str(pushed), "-o", str(one), *words)
    run_here("render", *[str(pushed)] * 2, "-o", str(two), *words, "--caption", "b", "--overlay")
    alone, both = (np.asarray(Image.open(path)) for path in (one, two))
    assert both.shape == alone.shape
    assert np.array_equal(both[:100], alone[:100]), "a run over itself looks like one"
    assert not np.array_equal(both[100:], alone[100:]), "the second caption"


@pytest.mark.long
def test_plots_beside_the_run(pushed: Path, renderer: None, tmp_path: Path) -> None:
    lines = []
    for at in ("0.1", "0.4"):
        path = tmp_path / f"{at}.png"
        run_here("render", str(pushed), "-o", str(path), "--at", at, "--plot", "robot.truth.com[2]",
                 "--width", "300", "--height", "240")  # fmt: skip
        pixels = np.asarray(Image.open(path))
        assert pixels.shape == (262, 600, 3)
        red = (pixels[:, 300:] == (204, 38, 51)).all(axis=2)
        lines.append(float(np.flatnonzero(red.any(axis=0)).mean()))
    width = (lines[1] - lines[0]) / 0.3 * 0.5  # of 0.5 s
    assert 100 < width < 300, "the line is at the time that is shown"
    done = run_here("render", str(pushed), "--plot", "robot.truth.comm[2]", code=2)
    assert "robot.truth.com" in done.stderr


@pytest.mark.long
def test_mp4(pushed: Path, renderer: None, tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    path = tmp_path / "film.mp4"
    run_here(
        "render", str(pushed), "-o", str(path), "--to", "0.2", "--speed", "1", *SMALL, "--follow"
    )
    with av.open(str(path)) as film:
        (stream,) = film.streams.video
        assert (stream.width, stream.height, stream.average_rate) == (120, 122, 20)
        assert sum(1 for _ in film.decode(stream)) == 5


def test_what_is_shown_at_a_time(pushed: Path) -> None:
    take = Take(read(pushed), "p", Camera())
    assert take.row(0.0) == 0 and take.row(0.1011) == 50 and take.row(9.0) == len(take.time) - 1
    assert take.text(50) == "p  0.10 s  stand"
    weight = sum(force[2] for _, force in ((a, (b - a)) for a, b in take.arrows(200)))
    robot = find_robot("bruce")
    assert weight == pytest.approx(force_scale(robot) * robot.weight, rel=0.1), (
        "the arrows of a robot that stands"
    )
    np.testing.assert_allclose(instants([take], 0.1, 0.2, 0.05), [0.1, 0.15, 0.2])
    with pytest.raises(
        AloftError, match=r"no pictures from 0\.4 s to 7 s: .* is from 0 s to 0\.498 s"
    ):
        instants([take], 0.4, 7.0, 0.05)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (
            ["-o", "film.avi"],
            "film.avi ends with none of .gif, .mp4, .png, which say what to write",
        ),
        (["-o", "film.png"], "a .png shows the run at one time: give both a .png and --at TIME"),
        (["-o", "film.gif", "--at", "0.1"], "a .png shows the run at one time"),
        (["--caption", "a", "--caption", "b"], "1 recordings, but 2 captions"),
        (["--from", "3"], "no pictures from 3 s to 0.498 s"),
    ],
)
def test_what_cannot_be_is_refused(pushed: Path, words: list[str], reason: str) -> None:
    assert reason in run_for_json("render", str(pushed), *words, code=2)["reason"]


def test_a_recording_without_a_robot(counted: bytes, tmp_path: Path) -> None:
    (tmp_path / "count.rrd").write_bytes(counted)
    reason = run_for_json("render", str(tmp_path / "count.rrd"), code=2)["reason"]
    assert reason.endswith("count.rrd has no robot: nothing in it says where one is")


def test_a_recording_without_a_tick(tmp_path: Path) -> None:
    (tmp_path / "stops.py").write_text(
        "from aloft import Block, Output\n"
        "from aloft.blocks.general.vectors import Number\n"
        "class Stops(Block):\n    y = Output(Number, text='nothing')\n"
        "    def step(self): raise ValueError('at once')\n"
    )
    (tmp_path / "stops.yaml").write_text("include: [aloft:sway]\nblocks: {s: {use: stops:Stops}}\n")
    load(tmp_path / "stops.yaml").run(sinks=[Recorder(tmp_path / "stops.rrd")], log=False)
    reason = run_for_json("render", str(tmp_path / "stops.rrd"), code=2)["reason"]
    assert reason.endswith("stops.rrd holds no tick; there is nothing to draw")


def test_the_whole_robot_is_in_the_picture_head_and_soles_included(pushed: Path) -> None:
    run = read(pushed)
    take = Take(run, "", Camera())
    bottom, top = extent(take.robot, take.base[:1], take.turn[:1], take.joints[:1])
    assert 0.6 < top[2] - bottom[2] < 0.8, "BRUCE stands about 0.66 m high"
    view = take.view(0)
    sees = view.distance * np.tan(np.radians(45.0 / 2))  # MuJoCo's field of view, upright
    assert view.look_at[2] + sees > top[2] + 0.05 and view.look_at[2] - sees < bottom[2] - 0.05
