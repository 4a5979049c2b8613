"""``aloft keys`` makes what parts need to talk over TLS, and a run refuses what does not fit."""

from pathlib import Path

import pytest
from tests.cli.conftest import run_for_json, run_here, run_parts_for_json
from tests.cli.test_run_machines import BLOCKS, GRAPH
from tests.needed import needs

needs("cryptography")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "pieces.py").write_text(BLOCKS)
    (tmp_path / "graph.yaml").write_text(GRAPH.replace("tcp/", "tls/"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.long
def test_a_run_over_tls_gives_the_bytes_of_one_process(here: Path) -> None:
    made = run_for_json("keys", "graph.yaml", "-o", "keys", "--observer", "viewer")
    assert made["made"] == ["onboard", "ground", "viewer"]
    assert made["machines"]["ground"] == [
        "aloft/graph/beacon/ground/onboard", "aloft/graph/tick/ground/onboard",
        "aloft/graph/data/ground/onboard/controller",
    ]  # fmt: skip
    together = run_parts_for_json("run", "graph.yaml", "--local", "--no-record", "--keys", "keys")
    expected = run_for_json("run", "graph.yaml", "--no-record")
    assert together["run_hash"] == expected["run_hash"] and together["ticks"] == 60
    shown = run_here("keys", "graph.yaml", "-o", "keys", "--observer", "viewer").stdout
    assert "viewer" in shown and "kept" in shown and "made" not in shown
    assert "aloft run graph.yaml --machine NAME --keys keys" in shown


def test_what_does_not_fit_is_refused(here: Path) -> None:
    for arguments, reason in [
        (("run", "graph.yaml", "--machine", "ground"), "`aloft keys GRAPH` makes them"),
        (("run", "graph.yaml", "--keys", "keys"), "--keys is for links between machines"),
        (("run", "graph.yaml", "--machine", "ground", "--keys", "none"), "is missing: `aloft keys"),
        (
            ("keys", "graph.yaml", "--set", "machines.ground=tcp/127.0.0.1:7451"),
            "--set machines.ground=tls/127.0.0.1:7451",
        ),
    ]:
        assert reason in run_for_json(*arguments, code=2)["reason"]
