"""Networks that are slow or interrupted for a while: what can go on goes on, and a refusal says what was measured.

The test makes network namespaces and limits the rate of their cables (``tc``). Where that is not permitted it is
skipped; the other tests of links then stand for it, over the loopback.
"""

import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from .test_run_machines import BLOCKS
from .test_three_namespaces import MACHINES, Network, ip, said

pytestmark = pytest.mark.long

LARGE = BLOCKS.replace(
    'value = Field(text="a number")', 'value = Field(text="a number")\n    more = Field(12500)'
)
GRAPH = f"""
rate: 100 Hz
duration: 40 ms
machines: {{onboard: tcp/{MACHINES["onboard"]}:7450, ground: tcp/{MACHINES["ground"]}:7451}}
blocks:
  robot: {{use: "pieces:Robot", in: {{u: controller.y}}}}
  controller: {{use: "pieces:Controller", in: {{u: robot.y}}, on: ground}}
"""


def tc(*arguments: str) -> None:
    done = subprocess.run(
        ["tc", *arguments], check=False, capture_output=True, text=True, timeout=20.0
    )
    if done.returncode:
        raise OSError(f"tc {' '.join(arguments)}: {done.stderr.strip()}")


def limit(network: Network, rate: str) -> None:
    """Let the cables of both machines carry no more than ``rate`` each way."""
    for machine in ("onboard", "ground"):
        tc("-n", network.name(machine), "qdisc", "replace", "dev", "cable", "root", "tbf",
           "rate", rate, "burst", "16kb", "latency", "400ms")  # fmt: skip


@pytest.fixture
def network() -> Iterator[Network]:
    for program in ("ip", "tc"):
        if shutil.which(program) is None:
            pytest.skip(f"there is no program {program} (iproute2) to make slow networks with")
    made = Network()
    try:
        made.make()
        limit(made, "2mbit")
    except OSError as error:
        made.remove()
        pytest.skip(f"slow networks cannot be made here: {error}")
    yield made
    made.remove()


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "pieces.py").write_text(LARGE)
    (tmp_path / "graph.yaml").write_text(GRAPH)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_both(network: Network, *sets: str) -> list[dict[str, object]]:
    settings = [word for text in sets for word in ("--set", text)]
    parts = [network.part(name, "--no-record", *settings) for name in ("ground", "onboard")]
    return [said(part) for part in parts]


def test_messages_of_100_kb_at_2_mbit_take_their_time(network: Network, here: Path) -> None:
    for result in run_both(network):
        assert result["success"] and result["ticks"] == 4, result["reason"]


def wait_until_enabled(parts: Sequence[subprocess.Popen[str]], folder: Path) -> None:
    end = time.monotonic() + 90.0
    while not (folder / "enabled.txt").exists():
        assert time.monotonic() < end and all(part.poll() is None for part in parts)
        time.sleep(0.05)


def test_a_network_that_becomes_too_slow_is_refused_with_what_was_measured(
    network: Network, here: Path
) -> None:
    sets = ("--set", "links.patience=4 s", "--set", "duration=100 s")
    parts = [network.part(name, "--no-record", *sets) for name in ("ground", "onboard")]
    wait_until_enabled(parts, here)
    limit(network, "64kbit")  # 12 s for a message
    results = [said(part) for part in parts]
    reasons = " ".join(str(result["reason"]) for result in results)
    assert all(result["exit_code"] == 3 for result in results), reasons
    assert "kB/s" in reasons and "a tick needs 100 kB of it, 10 MB/s at 100 Hz" in reasons
    assert "too slow" in reasons or "(links.patience)" in reasons


def test_a_clock_that_is_a_day_ahead_makes_no_message_old(network: Network, here: Path) -> None:
    ahead = ["unshare", "--time", "--monotonic", "86400", "--boottime", "86400", "--fork"]
    try:
        subprocess.run([*ahead, "true"], check=True, capture_output=True, timeout=20.0)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"time namespaces cannot be made here: {error}")
    limit(network, "100mbit")
    settings = {"mode": "free", "max_age": "20 s", "late": "stop"}
    sets = ["--set", "clock.kind=paced", "--set", "duration=3 s"]
    sets += [word for key, value in settings.items() for word in ("--set", f"links.{key}={value}")]
    parts = [
        network.part("ground", "--no-record", *sets, before=ahead),
        network.part("onboard", "--no-record", *sets),
    ]
    for result, sign in zip([said(part) for part in parts], (-1, 1), strict=True):
        assert result["success"], result["reason"]
        (clock,) = result["clocks"].values()
        assert abs(clock["offset_s"] - sign * 86400.0) < 1.0 + clock["uncertainty_s"]
        assert result["links"][0]["late_ticks"] == 0 < result["links"][0]["received"]


@pytest.mark.parametrize(("seconds", "lease"), [(0.4, "3 s"), (1.2, "3 s"), (4.0, "500 ms")])
def test_a_cut_ends_a_run_if_it_outlasts_the_lease(
    network: Network, here: Path, seconds: float, lease: str
) -> None:
    limit(network, "100mbit")
    settings = ["--set", "clock.kind=paced", "--set", f"links.lease={lease}"]
    parts = [
        network.part(name, "--no-record", "--set", "duration=20 s", *settings)
        for name in ("ground", "onboard")
    ]
    wait_until_enabled(parts, here)
    time.sleep(1.0)
    ip("-n", network.switch, "link", "set", "ground", "down")
    time.sleep(seconds)
    ip("-n", network.switch, "link", "set", "ground", "up")
    results = [said(part) for part in parts]
    reasons = [str(result["reason"]) for result in results]
    if seconds < 3.0:
        assert all(result["success"] and result["ticks"] == 2000 for result in results), reasons
        return
    assert all(result["exit_code"] == 3 for result in results), reasons
    assert any(
        "the network to it is cut or too slow: nothing came of it" in text for text in reasons
    )
    assert any("and links.lease is 0.5 s; before, " in text for text in reasons)
    assert (here / "damping.txt").exists()
