"""Machines without processors or shared memory to spare: parts that are slow are no parts that are gone."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from .conftest import run_for_json
from .test_run_machines import alone, here

__all__ = ["here"]
pytestmark = pytest.mark.long

LOAD = 5
"""Busy processes for each processor: a load of ten on a machine with two."""
BUSY = "import time; end = time.monotonic() + 300.0\nwhile time.monotonic() < end: pass"
SMALL = (
    'mount -t tmpfs -o size=4k tmpfs /dev/shm && head -c 4096 /dev/zero > /dev/shm/full; exec "$@"'
)


@pytest.fixture
def busy() -> Iterator[None]:
    with ExitStack() as stack:
        for _ in range(LOAD * (os.cpu_count() or 1)):
            process = stack.enter_context(subprocess.Popen([sys.executable, "-c", BUSY]))
            stack.callback(process.kill)
        yield


@pytest.mark.parametrize("links", ["{}", "{mode: free, max_age: 20 s, late: stop}"])
def test_parts_on_a_busy_machine_do_not_take_each_other_for_gone(
    here: Path, busy: None, links: str
) -> None:
    graph = (here / "graph.yaml").read_text()
    graph += f"links: {links}\nclock: {{kind: paced}}\n"
    (here / "graph.yaml").write_text(graph)
    result = run_for_json(
        "run", "graph.yaml", "--local", "--no-record", "--set", "duration=4 s", code=0
    )
    ticks = {name: part["ticks"] for name, part in result["machines"].items()}
    assert result["success"] and max(ticks.values()) == 800
    if links == "{}":
        assert result["reason"] in ("ran to its end", "") and set(ticks.values()) == {800}
    else:  # whichever runs free and is first at its end ends the others, in order
        ends = ("ran to its end", "", *(f"machine {name!r} has ended its run" for name in ticks))
        assert result["reason"] in ends


def test_a_full_folder_of_shared_memory_harms_no_run(here: Path) -> None:
    unshare = shutil.which("unshare")
    if unshare is None:
        pytest.skip("there is no program unshare (util-linux)")
    command = [unshare, "-Urm", "sh", "-c", SMALL, "sh"]
    if subprocess.run(
        [*command, "true"], check=False, capture_output=True, timeout=20.0
    ).returncode:
        pytest.skip("folders cannot be mounted in a namespace here")
    done = subprocess.run(
        [*command, sys.executable, "-m", "aloft", "run", "graph.yaml", "--local", "--json"],
        check=False, capture_output=True, text=True, timeout=200.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert f'"run_hash": "{alone()["run_hash"]}"' in done.stdout
    assert (here / "recordings" / "graph.rrd").exists()
