"""A disk or a limit that has no room for a recording: what can be kept is, and the exit code says so."""

import json
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from aloft.logs import read
from aloft.logs.exporting.export import export
from aloft.logs.recording import output_file as remedies
from aloft.logs.recording.output_file import remedy
from aloft.logs.recording.ring import ALIGNMENT, CONTROL, fitting_capacity

GRAPH = """\
rate: 1 kHz
duration: 4 s
blocks:
  noise: {use: blocks.WhiteNoise, with: {n: 32, seed: 4}}
"""
OLD = b"the recording of another run"


@pytest.fixture
def aloft(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Calls the command line where files may have so many bytes, in a folder with a graph."""
    (tmp_path / "noise.yaml").write_text(GRAPH)
    (tmp_path / "old.rrd").write_bytes(OLD)

    def call(most: int, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "aloft", *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=240,
            check=False,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)),
        )

    return call


@pytest.mark.long
def test_what_there_is_room_for_is_kept(aloft: Any, tmp_path: Path) -> None:
    done = aloft(600_000, "run", "noise.yaml", "--record", "new.rrd", "--json")
    result = json.loads(done.stdout.splitlines()[-1])
    assert done.returncode == result["exit_code"] == 4
    assert result["success"] is True and result["recording"] == "new.rrd"
    kept = read(tmp_path / "new.rrd", damaged=True)
    count = len(kept.ticks)
    assert 0 < count < 4000 and kept.ticks.tolist() == list(range(count))
    error = done.stderr.splitlines()[-1]
    assert error == f"error: {result['recording_problem']}"
    assert error.startswith("error: the recording new.rrd is not whole: ")
    assert "new.rrd cannot be written any further (File too large)" in error
    assert f"{count} ticks are in it, {4000 - count} are not" in error
    assert "allow larger files than 0.6 MB (`ulimit -f`), or --record FILE" in error
    assert result["warnings"] == [result["recording_problem"]]
    assert not (tmp_path / "new.part.rrd").exists()


@pytest.mark.long
def test_where_nothing_can_be_kept_the_earlier_recording_stays(aloft: Any, tmp_path: Path) -> None:
    for most in (4096, 30_000):  # no ring, and no file
        done = aloft(most, "run", "noise.yaml", "--record", "old.rrd")
        assert done.returncode == 4, done.stderr
        assert "success: ran to its end" in done.stdout and "recording: " not in done.stdout
        errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
        assert len(errors) == 1
        assert errors[0].startswith("error: no recording: ")
        assert "old.rrd cannot be written" in errors[0] and "`ulimit -f`" in errors[0]
        assert (tmp_path / "old.rrd").read_bytes() == OLD
        assert not (tmp_path / "old.part.rrd").exists()


@pytest.mark.long
def test_a_run_that_fails_keeps_its_own_exit_code(aloft: Any, tmp_path: Path) -> None:
    bound = "  low: {use: blocks.Assertion, with: {n: 32, upper: 0.0}, in: {u: noise.y}}\n"
    (tmp_path / "noise.yaml").write_text(GRAPH + bound)
    done = aloft(4096, "run", "noise.yaml", "--record", "old.rrd")
    assert done.returncode in (1, 3), done.stderr
    assert "error: no recording: " in done.stderr


@pytest.mark.long
@pytest.mark.skipif(shutil.which("unshare") is None, reason="needs a file system of its own")
def test_a_full_disk(aloft: Any, tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    mount = "mount -t tmpfs -o size=500k none disk"
    if subprocess.run(["unshare", "-rm", "sh", "-c", mount], cwd=tmp_path, check=False).returncode:
        pytest.skip("this user may mount nothing")
    call = f"{sys.executable} -m aloft run noise.yaml --record disk/new.rrd --quiet"
    script = f"{mount} && {call}; code=$?; cp disk/new.rrd kept.rrd; exit $code"
    done = subprocess.run(
        ["unshare", "-rm", "sh", "-c", script],
        cwd=tmp_path, capture_output=True, text=True, timeout=240, check=False,
    )  # fmt: skip
    assert done.returncode == 4, done.stderr
    count = len(read(tmp_path / "kept.rrd", damaged=True).ticks)
    error = done.stderr.splitlines()[-1]
    assert "(No space left on device)" in error and f"{count} ticks are in it" in error
    assert f"make room on the disk of {tmp_path / 'disk'} (0." in error
    assert count > 0


@pytest.mark.long
@pytest.mark.parametrize("kind", ["csv", "parquet", "mcap"])
def test_an_export_is_whole_or_not_there(aloft: Any, tmp_path: Path, kind: str) -> None:
    if kind == "mcap":
        pytest.importorskip("mcap")
    if not (tmp_path / "all.rrd").exists():
        aloft(resource.RLIM_INFINITY, "run", "noise.yaml", "--record", "all.rrd", "--quiet")
    out = tmp_path / f"old.{kind}"
    out.write_bytes(OLD)
    done = aloft(200_000, "log", "export", "all.rrd", f"--{kind}", "-o", out.name)
    assert done.returncode == 2, done.stderr
    assert f"old.{kind} cannot be written: " in done.stderr
    assert "`ulimit -f`), or -o FILE writes elsewhere" in done.stderr.replace("\n", " ")
    assert out.read_bytes() == OLD
    assert not list(tmp_path.glob("*.part.*"))
    export(kind, read(tmp_path / "all.rrd"), out)
    assert out.stat().st_size > 200_000


def test_every_reason_has_a_fix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import errno

    path = tmp_path / "a.rrd"
    assert remedy(errno.ENOSPC, path).startswith(f"make room on the disk of {tmp_path} (")
    assert remedy(errno.EACCES, path).startswith("allow writing there, or --record FILE")
    assert remedy(errno.EIO, path) == remedies.ELSEWHERE
    assert remedy(errno.EFBIG, None, "-o FILE").endswith("(`ulimit -f`), or -o FILE")


def test_the_ring_is_as_large_as_files_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    assert fitting_capacity(1000, 64) == 1024
    monkeypatch.setattr(resource, "getrlimit", lambda _: (10_000, 10_000))
    found = fitting_capacity(1 << 20, 64)
    assert 9000 < found <= 10_000 - CONTROL and found % ALIGNMENT == 0
    assert fitting_capacity(1 << 20, 20_000) >= 20_000
