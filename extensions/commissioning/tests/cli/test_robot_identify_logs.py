"""``aloft robot identify`` on logs of a real double pendulum: fitted on slow runs, judged on a swing-up."""

from __future__ import annotations

import pytest
from tests.cli.conftest import run_for_json, run_here
from tests.shared_data import FOLDER, needs_pendulum

SLOW = ("143339", "143524", "143601", "143704")
PUBLISHED = {"Joint1": 0.201, "Joint2": 0.099}
"""What the published parameters leave of the swing-up's torques [N m]."""
MOMENT, INERTIA = 0.15995, 0.05087
"""Their first moment of the second link [kg m] and its inertia about the joint [kg m^2]."""


@pytest.fixture
def graphs(tmp_path):
    data = FOLDER / "double_pendulum"
    (tmp_path / "pendubot.urdf").write_text((data / "pendubot.urdf").read_text())
    (tmp_path / "pendubot.yaml").write_text(
        "file: pendubot.urdf\nname: pendubot\ntext: of a log\nbase_joint: fixed\n"
        "profiles: {rated: {friction: 0.1, damping: 0.001, rotor_inertia: 0.00226}}\nsensors: {imu: false, switches: false}\n"
    )
    files = {}
    for name in (*SLOW, "154220"):
        files[name] = tmp_path / f"{name}.yaml"
        files[name].write_text(
            "rate: 500 Hz\nrobot: pendubot.yaml\nblocks:\n  robot:\n    use: hal.LogRobot\n    with:\n"
            f"      file: {data / f'sysid_{name}.csv'}\n      clock: {{stamps: time}}\n"
            "      joints:\n        names: [Joint1, Joint2]\n        position: [pos_meas1, pos_meas2]\n"
            "        torque: [tau_meas1, tau_meas2]\n        commanded: [tau_con1, tau_con2]\n"
        )
    return files


@needs_pendulum
@pytest.mark.long
def test_a_fit_of_slow_runs_explains_a_swing_up_as_well_as_the_published_parameters(graphs):
    slow = [str(graphs[name]) for name in SLOW]
    found = run_for_json("robot", "identify", *slow, "--held-out", str(graphs["154220"]))
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


@needs_pendulum
def test_logs_without_torques_say_what_cannot_be_told(graphs):
    file = graphs[SLOW[0]]
    text = file.read_text().replace("        torque: [tau_meas1, tau_meas2]\n", "")
    file.write_text(text)
    done = run_here("robot", "identify", str(file), code=2)
    assert "has no torques, so masses" in " ".join(done.stderr.split())
