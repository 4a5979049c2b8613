"""``aloft robot identify`` on logs of a real double pendulum: fitted on slow runs, judged on a swing-up."""

from __future__ import annotations

import pytest
import yaml
from tests.cli.conftest import run_for_json, run_here
from tests.shared_data import needs_icub, needs_pendulum

from aloft.lab.studies import icub_estimators
from aloft.lab.studies.pendulum_dynamics import HELD_OUT, SLOW, write_graphs
from aloft.robots.description import find_robot

PUBLISHED = {"Joint1": 0.201, "Joint2": 0.099}
"""What the published parameters leave of the swing-up's torques [N m]."""
MOMENT, INERTIA = 0.15995, 0.05087
"""Their first moment of the second link [kg m] and its inertia about the joint [kg m^2]."""


@pytest.fixture
def graphs(tmp_path):
    return write_graphs(tmp_path)


@needs_pendulum
@pytest.mark.long
def test_a_fit_of_slow_runs_explains_a_swing_up_as_well_as_the_published_parameters(
    graphs, tmp_path
):
    slow = [str(graphs[name]) for name in SLOW]
    out = tmp_path / "found.yaml"
    found = run_for_json(
        "robot", "identify", *slow, "--held-out", str(graphs[HELD_OUT]), "--out", str(out)
    )
    judged = found["residuals"][-1]
    assert judged["held_out"]
    for joint, most in PUBLISHED.items():
        assert judged["fitted"][joint] <= most
    base = found["values"]["base"]
    moment, inertia = base["Link2 m z"], base["Link2 Ixx"]
    assert abs(-moment["value"] - MOMENT) < 2.0 * moment["std"]
    assert abs(inertia["value"] - INERTIA) < 2.0 * inertia["std"]
    for link in found["links"].values():
        assert link["mass"] > 0.0
    profile = out.read_text()
    own = tmp_path / "identified.yaml"
    own.write_text("file: pendubot.urdf\nname: pendubot\nbase_joint: fixed\n" + profile)
    friction = find_robot(str(own)).motors.friction
    assert friction[1] == pytest.approx(found["values"]["coulomb"]["Joint2"]["value"], abs=1e-6)


@needs_pendulum
def test_logs_without_torques_say_what_cannot_be_told(graphs):
    file = graphs[SLOW[0]]
    text = file.read_text().replace("        torque: [tau_meas1, tau_meas2]\n", "")
    file.write_text(text)
    done = run_here("robot", "identify", str(file), code=2)
    assert "has no torques, so masses" in " ".join(done.stderr.split())


@needs_icub
@pytest.mark.long
def test_normal_forces_of_a_walk_weigh_an_icub(tmp_path):
    """Standing, its soles show 34.0 kg, on one foot 31 to 32, for a lifted one shows 7 to 15 N; the description has 33.1."""
    robot = icub_estimators.write_robot(tmp_path)
    file, out = tmp_path / "walk.yaml", tmp_path / "found.yaml"
    walk = icub_estimators.graph_of(robot, "walking.mat", 100, "StateEstimator", 0.0)
    file.write_text(yaml.safe_dump(walk))
    found = run_for_json("robot", "identify", str(file), "--out", str(out))
    mass = found["values"]["base"]["whole mass"]
    assert mass["value"] == pytest.approx(31.6, abs=0.5) and mass["std"] < 0.5
    assert found["values"]["coulomb"] == {}
    assert sum("near the description's" in text for text in found["untold"]) > 200
    assert "profiles" not in out.read_text() and "# l_sole" not in out.read_text()
    shown = run_here("robot", "identify", str(file))
    assert "whole mass" in shown.stdout and "force z of the base" in shown.stdout
    sway = tmp_path / "sway.yaml"
    sway.write_text(file.read_text().replace("walking.mat", "com-sinusoid.mat"))
    done = run_here("robot", "identify", str(sway), code=2)
    assert "leave 0.0% of the equations of com-sinusoid.mat: its feet stand" in " ".join(
        done.stderr.split()
    )
