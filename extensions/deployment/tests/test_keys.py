"""Certificates and least access, tried on real sessions over TLS: who may not command does not."""

import json
import os
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.needed import needs
from tests.runtime.links.example_graphs import ring
from tests.waiting import free_port, wait_for

from aloft.extensions.deployment.keys import (
    AUTHORITY_KEY,
    Authority,
    host_of,
    make_keys,
)
from aloft.runtime.language.errors import AloftError
from aloft.runtime.language.stages import MachineSpec
from aloft.runtime.placement.placed import PlacedGraph, split_over_machines
from aloft.runtime.transports.tls import KEY, SESSION, secured
from aloft.runtime.transports.transport import data_key
from aloft.runtime.transports.zenoh_session import (
    access_control,
    keys_from,
    observers_access,
    session_config,
)
from aloft.runtime.transports.zenoh_transport import ZenohTransport

needs("cryptography")
COMMANDS = "aloft/{}/data/far/onboard/last"


def placed_with_tls() -> PlacedGraph:
    graph = ring()
    machines = tuple(
        MachineSpec(spec.name, f"tls/127.0.0.1:{free_port()}") for spec in graph.machines
    )
    return split_over_machines(replace(graph, machines=machines))


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> tuple[PlacedGraph, Path]:
    placed = placed_with_tls()
    folder = tmp_path_factory.mktemp("keys") / "keys"
    assert make_keys(placed, folder, ["viewer"]) == ["onboard", "near", "far", "viewer"]
    return placed, folder


Opened = Callable[..., Any]


@pytest.fixture
def opened() -> Iterator[Opened]:
    """Opens sessions, and closes them after the test."""
    import zenoh

    with ExitStack() as stack:

        def open_session(
            placed: PlacedGraph, folder: Path, name: str, extra: dict[str, Any] | None = None
        ) -> Any:
            ends = {spec.name: spec.endpoint for spec in placed.machines}
            settings = {**secured(placed, folder, name), **(extra or {})}
            session = zenoh.open(session_config([], [ends["onboard"]], settings))
            return stack.enter_context(session)

        yield open_session


class Onboard:
    """The robot's machine: it hears commands, tells its state, and may be watched."""

    def __init__(self, placed: PlacedGraph, folder: Path) -> None:
        self.transport = ZenohTransport(
            placed.graph.name, placed.machines, security=secured(placed, folder, "onboard")
        )
        self.heard: list[bytes] = []
        self.transport.open("onboard", lambda name: None)
        self.transport.subscribe(data_key("far", "onboard", "last"), self.heard.append)
        self.tell = self.transport.publisher(data_key("onboard", "near", "robot"))
        self.show = self.transport.publisher("watch/onboard/status")


@pytest.fixture
def onboard(keys: tuple[PlacedGraph, Path]) -> Iterator[Onboard]:
    made = Onboard(*keys)
    yield made
    made.transport.close()


def hears(session: Any, key: str) -> list[bytes]:
    import zenoh

    heard: list[bytes] = []

    def take(sample: Any) -> None:
        heard.append(sample.payload.to_bytes())

    session.declare_subscriber(key, zenoh.handlers.Callback(take, indirect=False))
    return heard


def test_a_machine_commands_and_hears_by_its_own_links(
    keys: tuple[PlacedGraph, Path], onboard: Onboard, opened: Opened
) -> None:
    placed, folder = keys
    name = placed.graph.name
    far = opened(placed, folder, "far")
    assert wait_for(lambda: far.put(COMMANDS.format(name), b"go") or bool(onboard.heard))
    near = opened(placed, folder, "near")
    state = hears(near, f"aloft/{name}/data/onboard/near/robot")
    assert wait_for(lambda: onboard.tell(b"state") or bool(state))


def silent(onboard: Onboard, put: Callable[[], object]) -> bool:
    """Whether nothing arrives although somebody puts again and again."""
    onboard.heard.clear()
    for _ in range(25):
        put()
        time.sleep(0.02)
    return not onboard.heard


@pytest.mark.long
def test_an_observer_watches_and_never_commands(
    keys: tuple[PlacedGraph, Path], onboard: Onboard, opened: Opened
) -> None:
    placed, folder = keys
    name = placed.graph.name
    viewer = opened(placed, folder, "viewer")
    seen = hears(viewer, f"aloft/{name}/watch/**")
    assert wait_for(lambda: onboard.show(b"status") or bool(seen))
    assert silent(onboard, lambda: viewer.put(COMMANDS.format(name), b"go"))
    # nor when it does not keep to its own session's rules
    rude = opened(placed, folder, "viewer", {"access_control": {"enabled": False}})
    rude_seen = hears(rude, f"aloft/{name}/watch/**")
    assert wait_for(lambda: onboard.show(b"status") or bool(rude_seen))
    assert silent(onboard, lambda: rude.put(COMMANDS.format(name), b"go"))
    # and what is on links it does not even hear: a slow one would hinder them
    data = hears(rude, f"aloft/{name}/data/**")
    assert silent(onboard, lambda: onboard.tell(b"state")) and not data


def test_a_machine_cannot_send_what_another_sends(
    keys: tuple[PlacedGraph, Path], onboard: Onboard, opened: Opened
) -> None:
    placed, folder = keys
    near = opened(placed, folder, "near", {"access_control": {"enabled": False}})
    name = placed.graph.name
    state = hears(near, f"aloft/{name}/data/onboard/near/robot")
    assert wait_for(lambda: onboard.tell(b"state") or bool(state))
    assert silent(onboard, lambda: near.put(COMMANDS.format(name), b"go"))
    assert silent(onboard, lambda: near.put("aloft/**", b"go"))
    assert silent(onboard, lambda: near.delete(COMMANDS.format(name)))


def test_an_unknown_name_of_the_authority_hears_and_sends_nothing(
    keys: tuple[PlacedGraph, Path], onboard: Onboard, opened: Opened, tmp_path: Path
) -> None:
    placed, folder = keys
    Authority.read(folder).sign("stranger", ["127.0.0.1"], 2, tmp_path / "viewer")
    (tmp_path / "viewer" / SESSION).write_bytes((folder / "viewer" / SESSION).read_bytes())
    stranger = opened(placed, tmp_path, "viewer", {"access_control": {"enabled": False}})
    name = placed.graph.name
    seen = hears(stranger, f"aloft/{name}/**")
    assert wait_for(lambda: len(list(stranger.info.peers_zid())) == 1)  # its certificate is good
    assert silent(onboard, lambda: stranger.put(COMMANDS.format(name), b"go"))
    seen.clear()  # a session hears itself
    assert silent(onboard, lambda: (onboard.show(b"status"), onboard.tell(b"state"))) and not seen


def test_a_certificate_of_another_authority_does_not_connect(
    keys: tuple[PlacedGraph, Path], onboard: Onboard, opened: Opened, tmp_path: Path
) -> None:
    placed, folder = keys
    make_keys(placed, tmp_path, ["viewer"])  # with the right names
    settings: dict[str, Any] = secured(placed, tmp_path, "far")
    tls = settings["transport/link/tls"]
    tls["root_ca_certificate"] = str(folder / "far" / "authority.pem")  # it would trust the robot
    far = opened(placed, folder, "far", {"transport/link/tls": tls})
    name = placed.graph.name
    assert silent(onboard, lambda: far.put(COMMANDS.format(name), b"go"))
    assert list(far.info.peers_zid()) == []


def test_without_a_certificate_nobody_connects(
    keys: tuple[PlacedGraph, Path], onboard: Onboard, opened: Opened
) -> None:
    placed, folder = keys
    tls = secured(placed, folder, "far")["transport/link/tls"]
    only = {"root_ca_certificate": tls["root_ca_certificate"]}
    far = opened(placed, folder, "far", {"transport/link/tls": only})
    assert silent(onboard, lambda: far.put(COMMANDS.format(placed.graph.name), b"go"))


def test_access_is_what_the_wires_need() -> None:
    placed = placed_with_tls()
    name = placed.graph.name
    access = access_control(placed, "onboard", ["viewer"])
    assert access["default_permission"] == "deny" and access["enabled"]
    rules = {rule["id"]: rule for rule in access["rules"]}
    assert rules["far sends"]["key_exprs"] == [
        f"aloft/{name}/beacon/far/onboard", f"aloft/{name}/tick/far/onboard",
        f"aloft/{name}/data/far/onboard/last",
    ]  # fmt: skip
    assert rules["far sends"]["flows"] == ["ingress"] and rules["far sends"]["messages"] == ["put"]
    assert not any("data/" in key for key in rules["near sends"]["key_exprs"])  # no such wire
    assert {policy["subjects"][0] for policy in access["policies"]} == {"near", "far", "observers"}
    sending = [r for r in observers_access(placed, "viewer")["rules"] if "egress" in r["flows"]]
    assert [rule["messages"] for rule in sending] == [["declare_subscriber"]]
    assert "observers" not in json.dumps(access_control(placed, "onboard"))
    assert keys_from(placed, "onboard", "near")[-1] == f"aloft/{name}/data/onboard/near/robot"


def test_zenoh_reads_the_sessions_that_were_written(
    keys: tuple[PlacedGraph, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    import zenoh

    _, folder = keys
    for name in ("onboard", "viewer"):
        monkeypatch.chdir(folder / name)
        config = zenoh.Config.from_file(SESSION)
        assert json.loads(config.get_json("transport/link/tls/enable_mtls")) is True
        assert json.loads(config.get_json("access_control/default_permission")) == "deny"
    assert json.loads(config.get_json("listen/endpoints")) == []
    assert len(json.loads(config.get_json("connect/endpoints"))) == 3


def test_secrets_are_the_owners_alone(keys: tuple[PlacedGraph, Path]) -> None:
    _, folder = keys
    for path in (folder / AUTHORITY_KEY, folder / "far" / KEY):
        assert stat.S_IMODE(os.stat(path).st_mode) == 0o600
    assert not (folder / "far" / AUTHORITY_KEY).exists()


def test_what_is_there_is_kept_until_it_no_longer_fits(tmp_path: Path) -> None:
    placed = placed_with_tls()
    make_keys(placed, tmp_path)
    before = (tmp_path / "far" / KEY).read_bytes()
    assert make_keys(placed, tmp_path, ["viewer"]) == ["viewer"]
    assert (tmp_path / "far" / KEY).read_bytes() == before
    moved = tuple(
        replace(spec, endpoint="tls/robot.local:7450") if spec.name == "far" else spec
        for spec in placed.machines
    )
    there = split_over_machines(replace(placed.graph, machines=moved))
    assert make_keys(there, tmp_path) == ["far"]  # its address is in its certificate
    assert make_keys(there, tmp_path, anew=True) == ["onboard", "near", "far"]
    (tmp_path / AUTHORITY_KEY).write_text("nonsense")
    with pytest.raises(AloftError, match="--anew makes another"):
        make_keys(there, tmp_path)


def test_errors_say_what_to_do(keys: tuple[PlacedGraph, Path], tmp_path: Path) -> None:
    placed, folder = keys
    with pytest.raises(AloftError, match=r"write machines: \{onboard: tls/127.0.0.1:7450\}"):
        make_keys(split_over_machines(ring()), tmp_path)
    with pytest.raises(AloftError, match="'far' cannot be an observer: the name is used already"):
        make_keys(placed, tmp_path, ["far"])
    with pytest.raises(AloftError, match="cannot name an observer"):
        make_keys(placed, tmp_path, ["../x"])
    with pytest.raises(AloftError, match=r"certificate.pem is missing: `aloft keys GRAPH -o"):
        secured(placed, tmp_path, "far")
    graph = replace(
        placed.graph,
        blocks=tuple(
            replace(spec, machine="far") if spec.path == "first" else spec
            for spec in placed.graph.blocks
        ),
    )
    with pytest.raises(AloftError, match="was made for another graph than"):
        secured(split_over_machines(graph), folder, "far")
    assert host_of("tls/[::1]:7450") == "::1" and host_of("tls/robot.local:7450") == "robot.local"


def test_folders_are_the_owners_alone(keys: tuple[PlacedGraph, Path]) -> None:
    placed, folder = keys
    found = [folder, *(folder / machine.name for machine in placed.machines)]
    assert {stat.S_IMODE(path.stat().st_mode) for path in found} == {0o700}
