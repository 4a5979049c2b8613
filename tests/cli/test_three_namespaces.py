"""Robot, controller and viewer in three network namespaces, joined by cables that can be pulled.

The test makes the namespaces and a switch, and removes them. Where that is not permitted it is skipped;
the other tests of links then stand for it, over the loopback.
"""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from .conftest import run_for_json
from .test_run_machines import BLOCKS, GRAPH

MACHINES = {"onboard": "10.77.61.1", "ground": "10.77.61.2", "viewer": "10.77.61.3"}
pytestmark = pytest.mark.long


def ip(*arguments: str) -> None:
    done = subprocess.run(
        ["ip", *arguments], check=False, capture_output=True, text=True, timeout=20.0
    )
    if done.returncode:
        raise OSError(f"ip {' '.join(arguments)}: {done.stderr.strip()}")


class Network:
    """Three namespaces on one switch, which is a namespace of its own."""

    def __init__(self) -> None:
        self.tag = f"al{os.getpid() % 100000}"
        self.switch = f"{self.tag}-switch"
        self.running: list[subprocess.Popen[str]] = []

    def name(self, machine: str) -> str:
        return f"{self.tag}-{machine}"

    def make(self) -> None:
        ip("netns", "add", self.switch)
        ip("-n", self.switch, "link", "add", "switch", "type", "bridge")
        ip("-n", self.switch, "link", "set", "switch", "up")
        for machine, address in MACHINES.items():
            own = self.name(machine)
            ip("netns", "add", own)
            ip("-n", own, "link", "set", "lo", "up")
            ip("-n", own, "link", "add", "cable", "type", "veth", "peer", "name", machine,
               "netns", self.switch)  # fmt: skip
            ip("-n", own, "addr", "add", f"{address}/24", "dev", "cable")
            ip("-n", own, "link", "set", "cable", "up")
            ip("-n", self.switch, "link", "set", machine, "master", "switch", "up")

    def remove(self) -> None:
        for process in self.running:
            process.kill()
            process.communicate()
        for name in (*map(self.name, MACHINES), self.switch):
            subprocess.run(
                ["ip", "netns", "del", name], check=False, capture_output=True, timeout=20.0
            )

    def cable(self, machine: str, state: str) -> None:
        """Pull the cable of a machine (``down``), or put it back (``up``)."""
        ip("-n", self.switch, "link", "set", machine, state)

    def start(
        self, machine: str, *arguments: str, before: Sequence[str] = ()
    ) -> subprocess.Popen[str]:
        """Start aloft on a machine, by the command ``before`` that gives it something else of its own."""
        inside = ["ip", "netns", "exec", self.name(machine), *before]
        command = [*inside, sys.executable, "-m", "aloft"]
        process = subprocess.Popen(
            [*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.running.append(process)
        return process

    def part(
        self, machine: str, *arguments: str, before: Sequence[str] = ()
    ) -> subprocess.Popen[str]:
        run = ("run", "graph.yaml", "--machine", machine, "--json")
        return self.start(machine, *run, *arguments, before=before)

    def ask(self, machine: str, *arguments: str) -> dict[str, Any]:
        return said(self.start(machine, *arguments, "--json"))


def said(process: subprocess.Popen[str]) -> dict[str, Any]:
    out, error = process.communicate(timeout=120.0)
    assert out, error
    found: dict[str, Any] = json.loads(out.splitlines()[-1])
    return found


@pytest.fixture
def network() -> Iterator[Network]:
    if shutil.which("ip") is None:
        pytest.skip("there is no program ip (iproute2) to make network namespaces with")
    made = Network()
    try:
        made.make()
    except OSError as error:
        made.remove()
        pytest.skip(f"network namespaces cannot be made here: {error}")
    yield made
    made.remove()


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "pieces.py").write_text(BLOCKS)
    text = GRAPH
    for machine, port in (("onboard", 7450), ("ground", 7451)):
        text = text.replace(f"127.0.0.1:{port}", f"{MACHINES[machine]}:{port}")
    (tmp_path / "graph.yaml").write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def free(**links: str) -> tuple[str, ...]:
    settings: Mapping[str, str] = {"mode": "free", "max_age": "60 s", "late": "hold", **links}
    sets = ("clock.kind=paced", "duration=1000 s", *(f"links.{k}={v}" for k, v in settings.items()))
    return tuple(text for each in sets for text in ("--set", each))


def wait_until_it_runs(network: Network, sets: tuple[str, ...]) -> dict[str, Any]:
    """What the viewer sees once both parts are past their first ticks."""
    end = time.monotonic() + 90.0
    while time.monotonic() < end:
        found = network.ask("viewer", "top", "graph.yaml", "--once", "--wait", "5", *sets)
        parts = found["machines"].values()
        if found["success"] and all(part.get("tick", -1) > 20 for part in parts):
            return found
    raise AssertionError(found)


def test_in_lockstep_the_bytes_are_those_of_one_process(network: Network, here: Path) -> None:
    parts = [
        network.part("ground", "--record", "b.rrd"),
        network.part("onboard", "--record", "a.rrd"),
    ]
    results = [said(part) for part in parts]
    assert all(result["success"] for result in results), results
    merged = run_for_json("log", "merge", "a.rrd", "b.rrd", "-o", "whole.rrd")
    alone = run_for_json("run", "graph.yaml", "--no-record")
    assert merged["run_hash"] == alone["run_hash"] and merged["ticks"] == 60


def test_a_pulled_cable_ends_in_damping_and_the_viewer_sees_it(
    network: Network, here: Path
) -> None:
    sets = free(watchdog="5 s")
    onboard = network.part("onboard", "--no-record", *sets)
    network.part("ground", "--no-record", *sets)
    seen = wait_until_it_runs(network, sets)
    links = [link["name"] for part in seen["machines"].values() for link in part["links"]]
    assert links == ["controller@ground -> onboard", "robot@onboard -> ground"]
    network.cable("ground", "down")
    found = said(onboard)
    assert "brings commands and was silent for" in found["reason"], found["reason"]
    assert len((here / "damping.txt").read_text().splitlines()) >= 5
    seen = network.ask("viewer", "top", "graph.yaml", "--once", "--wait", "2", *sets)
    assert not seen["success"] and "ground" in seen["reason"]


def test_the_viewers_cable_hinders_nobody_and_one_that_is_put_back_is_heard_again(
    network: Network, here: Path
) -> None:
    sets = free(lease="500 ms")
    network.part("onboard", "--no-record", *sets)
    network.part("ground", "--no-record", *sets)
    before = wait_until_it_runs(network, sets)["machines"]["onboard"]
    network.cable("viewer", "down")
    time.sleep(1.5)
    network.cable("viewer", "up")
    network.cable("ground", "down")
    time.sleep(1.5)  # three leases: the session is lost
    network.cable("ground", "up")
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        after = wait_until_it_runs(network, sets)["machines"]["onboard"]
        if after["links"][0]["age_ms"] < 500.0 and after["tick"] > before["tick"]:
            break
    assert after["links"][0]["received"] > before["links"][0]["received"]
    assert after["links"][0]["age_ms"] < 500.0
    assert not (here / "damping.txt").exists()
