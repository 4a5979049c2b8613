"""``aloft jump``: what is asked for in words becomes a task, its plan, a run and a recording."""

from pathlib import Path
from typing import Any

import pytest

from aloft.cli.jump import load_jump, settings_for, task_changes, task_of
from aloft.cli.shared.robot_trials import TrialOptions, graph_of
from aloft.planner.library import library
from aloft.runtime.language.errors import AloftError
from aloft.studies.trials import trial_settings

from .conftest import Call, CallJson

BRUCE, _ = graph_of("bruce")


def _leg(side: str) -> str:
    x, y = LEGS[side]
    return f"""<body name="{side}_thigh" pos="{x} {y} -0.05">
<joint name="{side}_hip" axis="0 1 0" range="-90 90"/>
<geom type="capsule" fromto="0 0 -0.05 0 0 -0.15" size=".02" mass="0.5"/>
<body name="{side}_foot" pos="0 0 -0.2"><joint name="{side}_knee" axis="0 1 0" range="-150 -5"/>
<geom type="capsule" fromto="0 0 -0.05 0 0 -0.15" size=".015" mass="0.2"/>
<geom type="sphere" pos="0 0 -0.2" size=".02" mass="0.05"/></body></body>"""


LEGS = {"fl": (0.1, 0.1), "fr": (0.1, -0.1), "hl": (-0.1, 0.1), "hr": (-0.1, -0.1)}
STICKS = f"""<mujoco model="sticks"><compiler angle="degree"/><worldbody>
<body name="torso" pos="0 0 1"><freejoint/><geom type="box" size=".1 .1 .05" mass="5"/>
{"".join(map(_leg, LEGS))}</body></worldbody><actuator>
{"".join(f'<motor joint="{leg}_{joint}" gear="50" ctrlrange="-1 1"/>' for leg in LEGS for joint in ("hip", "knee"))}
</actuator></mujoco>"""
"""A robot on four legs that bend ahead and back."""


def changes(rise: str = "", turn: str = "", **lengths: str) -> dict[str, float]:
    return task_changes(lengths, rise, turn, BRUCE)


@pytest.mark.parametrize(
    ("words", "task"),
    [
        ({"forward": "20cm"}, {"distance_x": 0.2}),
        ({"back": "10 cm", "right": "50 mm"}, {"distance_x": -0.1, "distance_y": -0.05}),
        ({"left": "0.1 m", "rise": "15cm"}, {"distance_y": 0.1, "rise": 0.15}),
        ({"turn": "-30deg"}, {"twist": pytest.approx(-0.5236, abs=1e-4)}),
        ({"forward": "20cm", "down": "15cm"}, {"distance_x": 0.2, "landing_height": -0.15}),
        ({"forward": "20cm", "up": "3cm"}, {"distance_x": 0.2, "landing_height": 0.03}),
        (
            {"forward": "20cm", "up": "8cm"},
            {"distance_x": 0.2, "landing_height": 0.08, "rise": 0.15},
        ),
        (
            {"forward": "20cm", "up": "8cm", "rise": "13cm"},
            {"distance_x": 0.2, "landing_height": 0.08, "rise": 0.13},
        ),
        ({}, {}),
    ],
)
def test_words_become_a_task(words: dict[str, str], task: dict[str, Any]) -> None:
    assert changes(**words) == task


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ({"forward": "20"}, "--forward 20: the unit is missing; expected such as --forward 20cm"),
        ({"turn": "30"}, "--turn 30: the unit is missing; expected such as --turn 30deg"),
        ({"turn": "30cm"}, "--turn 30cm: '30cm' is not in rad; expected such as --turn 30deg"),
        ({"rise": "high"}, "--rise high: "),
        ({"forward": "3m"}, "--forward 3m: no jump is planned beyond 2 m"),
        ({"back": "210cm"}, "--back 210cm: no jump is planned beyond 2 m"),
        ({"down": "3m"}, "--down 3m: no jump is planned beyond 2 m"),
        ({"turn": "400deg"}, "--turn 400deg: no jump is planned beyond 361 deg"),
        ({"rise": "0cm"}, "--rise 0cm: it must be more than 0 m"),
        ({"up": "5cm", "down": "5cm"}, "--up and --down contradict each other: give one"),
    ],
)
def test_what_cannot_be_understood_is_said(words: dict[str, str], error: str) -> None:
    with pytest.raises(AloftError) as caught:
        changes(**words)
    assert str(caught.value).startswith(error)


def test_the_step_the_score_and_the_trial_are_in_the_graph() -> None:
    asked = {"distance_x": 0.2, "landing_height": 0.05}
    graph = load_jump(BRUCE, settings_for(asked, TrialOptions(trial="robust")), 7)
    robot, score = graph.checked.block("robot").params, graph.checked.block("score").params
    assert (robot.model_dump()["seed"], robot.model_dump()["body"]["mass_spread"]) == (7, 0.05)
    assert robot.model_dump()["ground"]["scene"]["boxes"][0]["top"] == 0.05
    assert score.model_dump()["distance"] == [0.2, 0.0]
    assert score.model_dump()["landing_height"] == 0.05
    assert task_of(graph).name == "12 cm high, 20 cm ahead, 5 cm up"


def test_a_trial_takes_back_what_only_another_sets() -> None:
    nominal = (
        load_jump(BRUCE, settings_for({}, TrialOptions(trial="nominal")), 0)
        .checked.block("robot")
        .params
    )
    assert nominal.model_dump()["sensors"]["gyro_noise"] == 0.0
    assert nominal.model_dump()["latency"] == 0.0
    assert nominal.model_dump()["timestep"] == 0.0005
    go2, _ = graph_of("go2")
    standard = (
        load_jump(go2, settings_for({}, TrialOptions(trial="standard")), 0)
        .checked.block("robot")
        .params
    )
    assert standard.model_dump()["body"]["mass_spread"] == 0.0
    assert standard.model_dump()["sensors"]["gyro_noise"] == 0.02
    with pytest.raises(
        AloftError,
        match="--trial windy: there is nominal, pushed, real, robust, standard, uneven, warm",
    ):
        trial_settings("windy")


def test_every_robot_with_a_shipped_jump_can_be_named() -> None:
    path, settings = graph_of("go2")
    assert (path.name, settings) == ("go2_jump.yaml", [])
    path, settings = graph_of("hyq")
    assert (path.name, settings[0]) == ("jump.yaml", "robot=hyq")
    with pytest.raises(
        AloftError, match=r"--robot atlas: no robot called 'atlas'; there is bruce, "
    ):
        graph_of("atlas")
    with pytest.raises(AloftError, match=r"--robot a\.urdf: no robot description at a\.urdf"):
        graph_of("a.urdf")


def test_a_file_of_a_robot_is_enough(folder: Path) -> None:
    (folder / "stick.xml").write_text(STICKS)
    path, own = graph_of(str(folder / "stick.xml"))
    graph = load_jump(path, [*own, *settings_for({"distance_x": 0.1}, TrialOptions())], 0)
    assert graph.checked.robot is not None
    assert [foot.name for foot in graph.checked.robot.feet] == [
        "fl_foot",
        "fr_foot",
        "hl_foot",
        "hr_foot",
    ]
    task = task_of(graph)
    assert (task.name, task.robot) == ("10 cm high, 10 cm ahead", "sticks")


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        ("<freejoint/>", "", "sticks cannot jump: its base is fixed: write base_joint: floating"),
        (
            ' gear="50"',
            ' gear="1"',
            "sticks cannot jump: motor fl_knee has 1 N m, and standing alone",
        ),
    ],
)
def test_what_keeps_a_robot_from_jumping_is_said(
    old: str, new: str, error: str, folder: Path, call_json: CallJson
) -> None:
    (folder / "stick.xml").write_text(STICKS.replace(old, new))
    found = call_json("jump", "--robot", str(folder / "stick.xml"), code=2)
    assert found["reason"].startswith(error)


def test_wrong_words_leave_with_exit_code_2(folder: Path, call: Call, call_json: CallJson) -> None:
    assert "the unit is missing" in call("jump", "--forward", "20", code=2).stderr
    assert "contradict" in call_json("jump", "--up", "1cm", "--down", "1cm", code=2)["reason"]
    graph = str(folder / "count.yaml")
    assert "needs a block 'plan'" in call_json("jump", "--graph", graph, code=2)["reason"]
    words = ("jump", "--set", "plan.task.rize=3")
    assert "the nearest is rise" in call_json(*words, code=2)["problems"][0]["message"]


@pytest.mark.long
def test_a_jump_beyond_the_motors_says_so(
    folder: Path, call_json: CallJson, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(library, "user_folder", lambda: folder / "kept")
    found = call_json("jump", "--rise", "90cm", "--no-nearest", code=1)
    assert found["success"] is False
    assert found["plan"]["success"] is False
    assert "90 cm high" in found["reason"]
    assert found["asked"] == {"rise": 0.9}


@pytest.mark.long
def test_one_line_plans_runs_and_records(folder: Path, call_json: CallJson) -> None:
    found = call_json("jump", "--forward", "20cm", "--rise", "8cm", "--seed", "3")
    assert found["success"] is True
    assert found["asked"] == {"distance_x": 0.2, "rise": 0.08}
    assert found["plan"]["valid"] is True
    assert found["metrics"]["jump_distance_x_m"] == pytest.approx(0.2, abs=0.02)
    assert (folder / "recordings" / "jump.rrd").stat().st_size > 100_000


def test_a_trial_takes_back_what_only_others_set() -> None:
    """Groups that are left out by default as a whole, and before what the trial sets within them."""
    robust, real = trial_settings("robust"), trial_settings("real")
    assert robust["robot.sensors.imu.bandwidth"] is None
    assert robust["robot.sensors.imu.gyro_delay"] == 0.0
    assert robust["robot.actuators.battery"] is None
    names = list(real)
    assert real["robot.sensors.imu.bandwidth"] == "100 Hz"
    inside = names.index("robot.actuators.battery.recovery_time")
    assert names.index("robot.actuators.battery") < inside
    assert "robot.ground" not in names, "the graph's own scene stays"
