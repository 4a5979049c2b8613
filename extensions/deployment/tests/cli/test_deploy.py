"""``aloft deploy`` writes all that a machine needs, says what is missing, and what it wrote runs alone."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from tests.cli.conftest import outcome, run_for_json, run_here

import aloft
from aloft import __version__
from aloft.logs.file.reader import read

PIECES = """
from helping import TWICE
from aloft import Block, Field, Input, Output, Parameters, Signal, State, parameter


class Number(Signal):
    value = Field(text="a number")


class Robot(Block):
    u = Input(Number)
    y = Output(Number)
    count = State(Number)

    def emit(self):
        self.y.value[()] = self.count.value

    def update(self):
        self.count.value += 1.0 + 0.5 * self.u.value

    def stop_cycle(self):
        pass


class Controller(Block):
    class Params(Parameters):
        gains: str = parameter("gains.txt", text="a file")

    params: Params
    u = Input(Number)
    y = Output(Number)

    def setup(self):
        self.gain = float((self.context.folder / self.params.gains).read_text())

    def step(self):
        self.y.value[()] = TWICE * self.gain * self.u.value
"""
GRAPH = """
rate: 200 Hz
duration: 300 ms
machines: {onboard: tcp/127.0.0.1:7456, ground: tcp/127.0.0.1:7457}
blocks:
  robot: {use: "pieces:Robot", in: {u: controller.y}}
  controller: {use: "pieces:Controller", with: {gains: tables/gains.txt}, in: {u: robot.y}, on: ground}
"""
HELPING = "TWICE = 2.0\n"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    source = tmp_path / "source"
    (source / "tables").mkdir(parents=True)
    (source / "tables" / "gains.txt").write_text("-0.01")
    (source / "pieces.py").write_text(PIECES)
    (source / "helping.py").write_text(HELPING)
    (source / "twins.yaml").write_text(GRAPH)
    monkeypatch.chdir(source)
    return tmp_path


def deploy(machine: str, to: Path, *more: str) -> dict[str, object]:
    arguments = ("deploy", "twins.yaml", "--machine", machine, "--out", str(to), *more)
    return run_for_json(*arguments, code=0)


def test_what_a_machine_needs_and_how_it_is_started(here: Path) -> None:
    told = deploy("ground", here / "ground")
    files = told["files"]
    assert isinstance(files, dict)
    assert set(files) == {
        "twins.yaml", "pieces.py", "helping.py", "tables/gains.txt", "run.sh", "requirements.txt",
        "Containerfile", "aloft-twins-ground.service",
    }  # fmt: skip
    assert told["moves_actuators"] is False
    assert f"aloft-robotics=={__version__}" in told["requirements"]  # type: ignore[operator]
    assert any(str(r).startswith("eclipse-zenoh==") for r in told["requirements"])  # type: ignore[attr-defined]
    about = json.loads((here / "ground" / "deployment.json").read_text())
    assert about["files"] == files and about["version"] == __version__
    unit = (here / "ground" / "aloft-twins-ground.service").read_text()
    assert "Restart=on-failure\n" in unit and "WantedBy=" in unit
    # the deployed graph is the same to the others
    texts = [aloft.load(path).checked.text for path in ("twins.yaml", here / "ground/twins.yaml")]
    assert texts[0] == texts[1]
    # a folder of an earlier deployment is written anew
    (here / "ground" / "left_over").touch()
    deploy("ground", here / "ground")
    assert not (here / "ground" / "left_over").exists()


def test_nothing_starts_motors_again(here: Path) -> None:
    told = deploy("onboard", here / "onboard")
    assert told["moves_actuators"] is True
    unit = (here / "onboard" / "aloft-twins-onboard.service").read_text()
    settings = [line for line in unit.splitlines() if not line.startswith("#")]
    assert [line for line in settings if line.startswith("Restart")] == ["Restart=no"]
    assert "[Install]" not in settings
    assert "--restart no" in (here / "onboard" / "Containerfile").read_text()


def test_all_that_is_missing_is_said_at_once(here: Path) -> None:
    (here / "elsewhere.txt").write_text("1.0")
    (here / "full").mkdir()
    (here / "full" / "mine.txt").touch()
    done = outcome(
        "deploy", "twins.yaml", "--machine", "ground", "--out", str(here / "full"),
        "--set", "controller.gains=../elsewhere.txt", "--keys", "keys", "--wheels", str(here),
    )  # fmt: skip
    assert done.returncode == 2 and not done.stdout
    said = " ".join(done.stderr.split())
    for part in (
        "twins cannot be deployed:",
        "--keys: no endpoint of the graph is tls/...; leave it out",
        f"controller.gains: {here}/source/../elsewhere.txt is not below the graph's folder; put it there",
        f"--wheels: {here} has no wheel of aloft-robotics {__version__}; `make release` makes it",
        f"{here}/full is there, and is none of `aloft deploy`; name another folder",
    ):
        assert part in said
    assert os.listdir(here / "full") == ["mine.txt"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--machine", "moon"), "the graph twins has no machine 'moon'; it has onboard, ground"),
        ((), "the graph twins has no machine ''; it has onboard, ground"),
        (
            ("--machine", "ground", "--set", "machines.ground=tls/127.0.0.1:7457",
             "--set", "machines.onboard=tls/127.0.0.1:7456"),
            "--keys: the endpoints are tls/...; name the folder of `aloft keys`",
        ),
        (("--machine", "ground", "--set", "controller.gains=none.txt"), "none.txt"),
    ],
)  # fmt: skip
def test_what_is_refused(here: Path, options: tuple[str, ...], said: str) -> None:
    done = outcome("deploy", "twins.yaml", "--out", "there", *options)
    assert done.returncode in (2, 3) and said in " ".join(done.stderr.split())
    assert not Path("there").exists()


def test_only_the_machines_own_keys_go_along(here: Path) -> None:
    pytest.importorskip("cryptography")
    secure = [
        f"--set=machines.{m}=tls/127.0.0.1:745{k}" for k, m in ((6, "onboard"), (7, "ground"))
    ]
    run_here("keys", "twins.yaml", *secure)
    files = deploy("ground", here / "ground", "--keys", "keys", *secure)["files"]
    assert isinstance(files, dict)
    mine = {name for name in files if name.startswith("keys/")}
    assert mine == {f"keys/{file.name}" for file in Path("keys/ground").iterdir()}
    assert "--keys keys" in (here / "ground" / "run.sh").read_text()


JAIL = """\
set -e
mount -t tmpfs none {root}
for each in /proc /dev; do mkdir -p {root}$each; mount --rbind $each {root}$each; done
for each in {shown}; do
    mkdir -p {root}$each; mount --bind $each {root}$each; mount -o remount,bind,ro {root}$each
done
mkdir -p {root}/tmp {root}/machines; mount --bind {machines} {root}/machines
ip link set lo up
run() {{
    machine=$1; shift
    chroot {root} env -i PATH={path} PYTHONPATH={python_path} OPENBLAS_NUM_THREADS=1 HOME=/tmp \\
        sh /machines/$machine/run.sh --json "$@" > {machines}/$machine.json 2> {machines}/$machine.txt
}}
run ground & other=$!
run onboard || code=$?
wait $other
exit ${{code:-0}}
"""


@pytest.mark.long
def test_deployed_parts_run_in_a_chroot_and_a_network_of_their_own(
    wheel: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is there but Python, its packages, aloft's wheel and the two folders: no source, no cache."""
    trial = ["unshare", "-mn", "chroot", "/", "ip", "link", "set", "lo", "up"]
    if not all(map(shutil.which, ("unshare", "chroot", "ip"))):
        pytest.skip("there is no unshare, chroot or ip")
    if subprocess.run(trial, check=False, capture_output=True).returncode:
        pytest.skip("namespaces of mounts and networks, or chroot, are not permitted here")
    monkeypatch.chdir(tmp_path)
    graph = Path(aloft.__file__).parent / "graphs" / "machines" / "jump_two.yaml"
    machines, installed = tmp_path / "machines", tmp_path / "installed"
    short = ("--set", "duration=400 ms")
    for machine in ("onboard", "ground"):
        to = str(machines / machine)
        run_here("deploy", str(graph), "--machine", machine, "--out", to, *short)
    zipfile.ZipFile(wheel).extractall(installed)
    program = installed / "bin" / "aloft"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -S -m aloft "$@"\n')
    program.chmod(0o755)
    packages = [entry for entry in sys.path if entry.endswith("site-packages")]
    shown = [*dict.fromkeys(("/bin", "/usr", "/lib", "/lib64", "/etc", sys.base_prefix, sys.prefix, str(installed)))]  # fmt: skip
    root = tmp_path / "root"
    root.mkdir()
    script = JAIL.format(
        root=root, machines=machines, shown=" ".join(filter(os.path.isdir, shown)),
        path=f"{program.parent}:/usr/bin:/bin", python_path=":".join([str(installed), *packages]),
    )  # fmt: skip
    done = subprocess.run(
        ["unshare", "-mn", "sh", "-c", script], check=False, capture_output=True, text=True, timeout=240.0
    )  # fmt: skip
    texts = [file.read_text() for file in sorted(machines.glob("*.*"))]
    assert done.returncode == 1, (done.stderr, texts)  # it is too short for a jump
    assert not any("Warning" in text for text in texts)
    parts = [machines / m / "recordings" / f"jump_two-{m}.rrd" for m in ("onboard", "ground")]
    run_here("log", "merge", *map(str, parts), "-o", "whole.rrd")
    expected = aloft.load(graph, short[1:]).run()
    assert expected.ticks == 200
    outcome_of_both = read("whole.rrd").outcome
    assert outcome_of_both is not None and outcome_of_both["run_hash"] == expected.run_hash
