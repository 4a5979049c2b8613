"""``aloft robot identify`` on logs of a real double pendulum: fitted on slow runs, judged on a swing-up."""

from __future__ import annotations

import pytest
from tests.cli.conftest import run_for_json, run_here
from tests.shared_data import needs_pendulum

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
