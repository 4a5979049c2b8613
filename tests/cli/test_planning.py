"""``aloft plan --library`` with real processes: the same bytes from any number of them, on a cluster
too, and nothing lost however it ends."""

import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from aloft.planner.task.plan import read_plan

from ..local_cluster import local_cluster
from .conftest import CallJson, Start

MANY = 16
"""Tasks, so that some are left when a busy machine lets the test see the first plan."""


def write_grid(folder: Path, count: int = 2) -> None:
    (folder / "grid.yaml").write_text(
        f"task: {{friction: 0.45}}\ngrid:\n  rise: {{from: 8 cm, to: 9 cm, count: {count}}}\n"
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.*")}


def children(pid: int) -> list[int]:
    """The worker processes of a process: its children that are not the tracker of resources."""
    listed = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [c for c in map(int, listed) if b"spawn_main" in Path(f"/proc/{c}/cmdline").read_bytes()]


def wait_for(condition: Callable[[], Any]) -> Any:
    end = time.monotonic() + 240.0
    while not (found := condition()):
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.01)
    return found


@pytest.mark.long
def test_any_number_of_workers_makes_the_same_bytes(folder: Path, call_json: CallJson) -> None:
    write_grid(folder)
    for workers in ("1", "2"):
        result = call_json(
            "plan", "--library", "grid.yaml", "--keep", workers, "--workers", workers
        )
        assert result["counts"] == {"planned": 2, "kept": 0, "failed": 0, "known": 0}
    one = contents(folder / "1")
    assert len(one) == 2
    assert one == contents(folder / "2")


@pytest.mark.long
def test_a_cluster_makes_the_same_bytes(folder: Path, call_json: CallJson) -> None:
    pytest.importorskip("distributed")
    write_grid(folder)
    call_json("plan", "--library", "grid.yaml", "--keep", "one", "--workers", "1")
    with local_cluster(folder) as address:
        call_json("plan", "--library", "grid.yaml", "--keep", "dask", "--cluster", address)
    assert len(contents(folder / "one")) == 2
    assert contents(folder / "one") == contents(folder / "dask")


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="finds processes in /proc")
def test_nothing_is_lost_when_workers_and_the_whole_are_killed(
    folder: Path, call_json: CallJson, start: Start
) -> None:
    write_grid(folder, count=MANY)
    arguments = ("plan", "--library", "grid.yaml", "--keep", "kept", "--workers", "2")
    whole = start(*arguments)
    kept = folder / "kept"
    wait_for(lambda: list(kept.glob("*.npz")))
    os.kill(wait_for(lambda: children(whole.pid))[0], signal.SIGKILL)
    wait_for(lambda: len(list(kept.glob("*.npz"))) > 1)
    whole.kill()
    whole.communicate(timeout=240)
    there = contents(kept)
    assert 1 < len(there) < MANY
    for name in there:
        assert read_plan(kept / name).valid
    result = call_json(*arguments)
    assert result["counts"]["kept"] >= len(there)
    assert result["counts"]["kept"] + result["counts"]["planned"] == MANY
    assert len(contents(kept)) == MANY


@pytest.mark.long
def test_a_signal_stops_a_grid_and_says_what_is_done(folder: Path, start: Start) -> None:
    write_grid(folder, count=10 * MANY)
    whole = start("plan", "--library", "grid.yaml", "--keep", "kept", "--workers", "1", "--json")
    wait_for(lambda: list((folder / "kept").glob("*.npz")))
    whole.send_signal(signal.SIGINT)
    output, errors = whole.communicate(timeout=240)
    assert whole.returncode == 130
    result = json.loads(output)
    assert result["success"] is False
    assert result["reason"].startswith("stopped by SIGINT after ")
    assert "the same command goes on from here" in result["reason"]
    assert "Traceback" not in errors


def test_no_cluster_is_one_clear_error(folder: Path, call_json: CallJson) -> None:
    pytest.importorskip("distributed")
    write_grid(folder)
    arguments = ("--keep", "kept", "--cluster", "nonsense://here")
    result = call_json("plan", "--library", "grid.yaml", *arguments, code=2)
    assert result["reason"].startswith("there is no Dask scheduler at 'nonsense://here'")
