"""``aloft robot``: what is printed of a robot, imports that write a YAML, and files that are wrong."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
import yaml
from PIL import Image
from typer.testing import CliRunner

import aloft
from aloft.cli.app import make_app
from aloft.robots.description import find_robot
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.run_result import RunResult

from ..robots.example_robots import needs_robots, urdf
from ..robots.importing.model_files import ARM, CART_POLE, ONE_LEG
from .conftest import run_for_json, run_here


def test_show_prints_the_tree_the_motors_the_feet_and_the_sensors() -> None:
    text = run_here("robot", "show", "bruce").stdout
    lines = [line.rstrip() for line in text.splitlines()]
    assert lines[0].startswith("bruce: Miniature biped of 0.66 m")
    assert "  5.118 kg, floating base (link torso), 10 joints, 2 feet, 4 contact points" in lines
    knee = next(line for line in lines if " right_knee " in line)
    assert knee.split() == [
        "right_calf", "0.113", "right_knee", "hinge", "0", "-1", "0", "-2.1", "to", "-0.02",
        "-0.8", "1",
    ]  # fmt: skip
    assert knee.startswith("         right_calf")  # four links out from the torso
    motor = next(line for line in lines if line.startswith(" right_hip_motor_a"))
    assert motor.split() == [
        "right_hip_motor_a", "(right_hip_pitch,", "right_hip_roll)", "10.5", "18", "30", "4",
        "0.00182", "0.07", "0.01",
    ]  # fmt: skip
    foot = next(line for line in lines if line.startswith(" left_foot"))
    assert foot.split() == ["left_foot", "line", "left_foot", "left_toe,", "left_heel"]
    assert "sensors: 10 encoders, an IMU, 4 switches" in lines
    assert not [line for line in lines if line.startswith("note:")]


def test_show_lists_the_effects_that_can_be_simulated() -> None:
    found = run_for_json("robot", "show", "bruce", "--effects")["effects"]
    rows = {".".join(filter(None, (row["group"], row["parameter"]))): row for row in found}
    bandwidth = rows["sensors.imu.bandwidth"]
    assert bandwidth["unit"] == "Hz" and bandwidth["default"] is None
    assert bandwidth["trial"] == "100 Hz"
    assert bandwidth["source"] == "data sheets of MEMS units: 5 to 400 Hz to choose from"
    assert rows["sensors.switch_threshold"]["trial"] == ["0.5 N", "3 N"], (
        "from a trial that it includes"
    )
    assert rows["sensors.gyro_noise"]["trial"] == "0.02 rad/s", "of an included trial"
    assert (
        rows["actuators.gears.stiffness"]["required"]
        and rows["actuators.gears.stiffness"]["group_is_off"]
    )
    assert rows["actuators.gears.stiffness"]["trial"] is None
    taken = {
        f"robot.{name}": row["trial"] for name, row in rows.items() if row["trial"] is not None
    }
    graph = aloft.load(Path(aloft.__file__).parent / "graphs/jump.yaml", overrides=taken)
    assert graph is not None, "every path and value is one that a graph takes"
    text = run_here("robot", "show", "bruce", "--effects").stdout
    line = next(line for line in text.splitlines() if " actuators.motors.saturation " in line)
    assert line.split()[:3] == ["actuators.motors.saturation", "0.0", "0.1"]


def test_show_for_programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cart.xml").write_text(CART_POLE)
    monkeypatch.chdir(tmp_path)
    about = run_for_json("robot", "show", "cart.xml")
    assert about["success"] and about["name"] == "cartpole" and about["base_joint"] == "fixed"
    assert [link["joint"] for link in about["links"]] == ["", "slider", "hinge"]
    assert about["links"][1]["limits"] == [-1.0, 1.0] and about["links"][2]["limits"] is None
    assert [link["unit"] for link in about["links"]] == ["", "m", "rad"]
    assert about["motors"][0]["peak_torque"] == 10.0 and about["feet"] == []
    assert about["motors"][0]["units"]["peak_torque"] == "N"
    assert about["motors"][1]["units"]["peak_torque"] == "N m"
    lines = [line.split() for line in run_here("robot", "show", "cart.xml").stdout.splitlines()]
    (joint,) = (line for line in lines if "slide" in line)
    assert joint[-7:] == ["-1", "to", "1", "m", "0", "m", "1"]
    (motor,) = (line for line in lines if line[:1] == ["slider"])
    assert motor[1:7] == ["10", "N", "12", "m/s", "20", "m/s"]
    assert about["sensors"] == {"encoders": 2, "imu": False, "switches": 0, "mounted": {}}
    assert about["missing"] == [
        "no speed limit of slider: 20 m/s is assumed",
        "no actuator moves hinge",
        "rotor inertia is zero; write rotor_inertia under profiles",
    ]


def test_what_is_missing_is_said_with_what_to_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "leg.xml").write_text(ONE_LEG)
    monkeypatch.chdir(tmp_path)
    guessed = run_here("robot", "show", "leg.xml").stdout
    assert "note: the feet are guessed: foot" in guessed and "standing is not given" in guessed
    (tmp_path / "leg.yaml").write_text("feet: []\n")
    notes = [n for n in run_here("robot", "show", "leg.xml").stdout.splitlines() if "note:" in n]
    assert notes == [
        (
            "note: left out: gains of servos, kp 100, kv 0 (knee) at the joint; gains follow from "
            "inertia and motor, and joint_pd.flight_stiffness in a graph sets them"
        ),
        "note: no speed limit of hip, knee: 20 rad/s is assumed",
        (
            "note: there are no feet, so the robot can be simulated but not stand or jump; write them "
            "under feet: [{name: NAME, at: LINK, radius: METRES}], or let aloft robot import guess"
        ),
    ]


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_it_is_drawn(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"bruce{suffix}"
    assert f"drawn to {path}" in run_here("robot", "show", "bruce", "--picture", str(path)).stdout
    first = path.read_bytes()
    if suffix == ".png":
        picture = Image.open(path).convert("RGB")
        colours = picture.getcolors(picture.width * picture.height)
        assert picture.width > 1000 and colours is not None and len(colours) > 50
    else:
        assert b"from the right" in first
        run_here("robot", "show", "bruce", "--picture", str(path))
        assert path.read_bytes() == first


def test_a_picture_of_another_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bruce.gif"
    errors = run_here("robot", "show", "bruce", "--picture", str(path), code=2).stderr
    assert "no picture: a picture is a .png or .svg file, not bruce.gif" in errors


def test_import_writes_what_it_finds_and_marks_what_it_guesses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "leg.xml").write_text(ONE_LEG)
    monkeypatch.chdir(tmp_path)
    text = run_here("robot", "import", "leg.xml").stdout
    assert "wrote leg.yaml: look at each part, then `aloft robot show leg.yaml`" in text
    written = (tmp_path / "leg.yaml").read_text()
    assert "# GUESSED: the ends of the limbs that reach lowest." in written
    data = yaml.safe_load(written)
    assert data["file"] == "leg.xml"
    assert data["feet"] == [{"name": "foot", "at": "foot", "radius": 0.035}]
    # The YAML beside the file and the file itself now give the same robot.
    robot = find_robot("leg.yaml", tmp_path)
    assert robot == find_robot("leg.xml", tmp_path) and len(robot.feet) == 1
    errors = run_here("robot", "import", "leg.xml", code=2).stderr
    assert "leg.yaml is there already; --force writes over it" in errors
    run_here("robot", "import", "leg.xml", "--force")
    assert run_for_json("robot", "import", "leg.xml", "-o", "b.yaml")["written"] == "b.yaml"
    assert find_robot("b.yaml", tmp_path).feet == robot.feet


@needs_robots
def test_import_finds_flat_feet_and_a_standing_pose(tmp_path: Path) -> None:
    out = tmp_path / "g1.yaml"
    run_here("robot", "import", str(urdf("g1")), "-o", str(out))
    data = yaml.safe_load(out.read_text())
    assert [foot["at"] for foot in data["feet"]] == [
        "left_ankle_roll_link",
        "right_ankle_roll_link",
    ]
    assert sorted(map(tuple, data["feet"][0]["points"])) == [
        (-0.05, -0.025, -0.035), (-0.05, 0.025, -0.035), (0.12, -0.03, -0.035),
        (0.12, 0.03, -0.035),
    ]  # fmt: skip
    assert len(data["standing"]) == 29
    about = run_for_json("robot", "show", str(out))
    assert [foot["kind"] for foot in about["feet"]] == ["flat", "flat"]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("x.urdf", "<html/>", "x.urdf: this is neither a URDF nor an MJCF file"),
        ("x.urdf", "no XML", "x.urdf:1:1: this is no XML: syntax error"),
        ("x.stl", "", "x.stl is no URDF or MJCF file: its name ends in none of .urdf, .xml, .mjcf"),
        ("x.urdf", None, "there is no file x.urdf"),
        (
            "x.urdf",
            ARM.replace('<mass value="1"/>', '<mass value="nan"/>', 2),
            "x.urdf:8:3: link upper has a mass or an inertia that no body has",
        ),
    ],
)
def test_what_cannot_be_imported(
    name: str, content: str | None, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if content is not None:
        (tmp_path / name).write_text(content)
    monkeypatch.chdir(tmp_path)
    assert message in run_here("robot", "import", name, code=2).stderr
    assert not (tmp_path / "x.yaml").exists()


def test_an_unknown_robot() -> None:
    errors = run_here("robot", "show", "brus", code=2).stderr
    assert (
        "no robot called 'brus'; there is bruce, a1, alexander, anymal_c, bolt, g1, go2, hyq,"
        in errors
    )


def test_faults_for_programs(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text("name: x\nbase: a\nlinks: [{name: a, mass: -1, com: [0, 0, 0],\n"
                    "  inertia: [1, 1, 1, 0, 0, 0]}]\njoints: []\n"
                    "profiles: {}\n")  # fmt: skip
    report = run_for_json("robot", "show", str(path), code=2)
    assert report["reason"] == f"{path}: 2 errors in the robot's description"
    assert report["errors"][0] == {
        "file": str(path), "line": 3, "column": 25, "path": ["links", 0, "mass"],
        "message": "link a has a mass of -1 kg", "expected": "a positive number of kg",
        "found": "-1", "fix": "mass: 0.1",
    }  # fmt: skip


def test_export_writes_a_urdf(tmp_path: Path) -> None:
    path = tmp_path / "bruce.urdf"
    run_here("robot", "export", "bruce", "--urdf", "-o", str(path))
    assert path.read_text() == run_here("robot", "export", "bruce").stdout
    model = pinocchio.buildModelFromUrdf(str(path), pinocchio.JointModelFreeFlyer())
    assert model.nv == 16 and pinocchio.computeTotalMass(model) == pytest.approx(5.118)
    missing = tmp_path / "no" / "bruce.urdf"
    errors = run_here("robot", "export", "bruce", "-o", str(missing), code=2).stderr
    assert f"{missing} cannot be written: No such file or directory" in errors


GRAPHS = Path(aloft.__file__).parent / "graphs"
INJECTED: dict[str, Any] = {
    "robot.seed": 5, "robot.body.mass_scale": 1.08, "robot.actuators.joint_friction": 1.6,
    "robot.latency": "4 ms", "robot.body.base_com_offset": ["4 mm", "0 mm", "0 mm"],
}  # fmt: skip


def identify(*arguments: str) -> Any:
    return CliRunner().invoke(make_app(), ["robot", "identify", *arguments])


def miss(result: RunResult) -> float:
    """How far [m] a jump in place has landed from where it began."""
    return math.hypot(result.metrics["jump_distance_x_m"], result.metrics["jump_distance_y_m"])


def apex_error(result: RunResult) -> float:
    """By how much [m] the apex was not the planned one."""
    found = result.metrics
    return abs(found["apex_above_standing_m"] - found["planned_apex_above_standing_m"])


@pytest.mark.long
def test_what_was_injected_is_found_and_makes_the_jump_better(tmp_path: Path) -> None:
    run = aloft.load(GRAPHS / "jump.yaml", INJECTED).run()
    aloft.write_recording(tmp_path / "heavy.rrd", run)
    result = identify(str(tmp_path / "heavy.rrd"), "--json", "--out", str(tmp_path / "found.yaml"))
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)

    def close(value: dict[str, float], truth: float, largest: float) -> None:
        assert abs(value["value"] - truth) < 3.0 * value["std"], (value, truth)
        assert value["std"] < largest

    body = found["body"]
    close(body["mass"], 1.08 * 5.118, 0.05)
    for offset, truth in zip(body["com_offset"], (0.004, 0.0, 0.0), strict=True):
        close(offset, truth, 0.004)
    assert len(body["coulomb"]) == 6 and "right_hip_yaw" in body["resting"]
    for value in body["coulomb"].values():
        close(value, 1.6 * 0.07, 0.07)
    for value in body["viscous"].values():
        close(value, 1.6 * 0.01, 0.05)
    mean = np.mean([value["value"] for value in body["coulomb"].values()])
    assert mean == pytest.approx(1.6 * 0.07, rel=0.15), "and not what the description says"
    before = aloft.load(GRAPHS / "jump.yaml", {"robot.seed": 5})
    assert float(before.run(duration=1.0).metrics["delay_measured_ms"]) + 2.0 == pytest.approx(
        1e3 * found["delay"]["delay"]["value"], abs=3e3 * found["delay"]["delay"]["std"]
    )

    again = tmp_path / "again.yaml"
    again.write_text(f"include: [{GRAPHS / 'jump.yaml'}, found.yaml]\n")
    landed = Executor(aloft.load(again, INJECTED).checked, log=False).run()
    assert landed.success, landed.reason
    assert miss(landed) < miss(run), "it lands nearer to its place"
    assert apex_error(landed) < 0.5 * apex_error(run), "it jumps as high as planned"
    assert landed.metrics["peak_tilt_deg"] < 0.7 * run.metrics["peak_tilt_deg"], "it tilts less"


def test_a_recording_that_does_not_tell_it_is_refused(tmp_path: Path) -> None:
    short = aloft.load(GRAPHS / "jump.yaml").run(duration=0.1)
    aloft.write_recording(tmp_path / "short.rrd", short)
    result = identify(str(tmp_path / "short.rrd"))
    assert result.exit_code != 0
    assert "ticks with moving joints and steady contacts; 160 are needed" in result.output
    result = identify(str(tmp_path / "short.rrd"), "--base", "pilot.base")
    assert result.exit_code != 0
    assert "no signal 'pilot.base.orientation'; the nearest are" in result.output
    assert "--robot, --base and --command say which blocks to read" in result.output
    result = identify(str(tmp_path / "nothing.rrd"))
    assert result.exit_code != 0 and "there is no such file" in result.output


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "give a graph or a recording, or a robot, such as --robot go2"),
        (["graph.yaml", "--robot", "go2"], "give a graph or a recording, or a robot"),
        (["--robot", "nobody"], "--robot nobody: no robot called 'nobody'; there is bruce"),
        (["run.rrd", "--set", "a=1"], "--set is for a graph; a recording has been made already"),
    ],
)
def test_a_calibration_says_what_it_needs(words: list[str], said: str) -> None:
    result = CliRunner().invoke(make_app(), ["robot", "calibrate", *words])
    assert result.exit_code == 2
    assert said in " ".join(result.output.split())
