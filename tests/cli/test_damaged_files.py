"""Every command that reads a recording or a plan, on files that were damaged at random.

A command ends with a result or with one error that names the file; never with a traceback or a
crash. The number of tries is small so that the test takes a bounded time; ``ALOFT_FUZZ=1000`` makes
it longer.
"""

import os
import random
from pathlib import Path

import pytest

from aloft.planner.library.library import shipped_folder

from .conftest import outcome

TRIES = int(os.environ.get("ALOFT_FUZZ", "6"))


def left(*arguments: str) -> tuple[int, str]:
    """The exit code and all that was printed."""
    done = outcome(*arguments, columns=200)
    return done.returncode, done.stdout + done.stderr


def damaged(data: bytes, draw: random.Random) -> bytes:
    """The bytes with one change of a kind that disks, copies and cables make."""
    kind, at = draw.randrange(6), draw.randrange(len(data))
    if kind == 0:  # a bit turned
        return data[:at] + bytes([data[at] ^ 1 << draw.randrange(8)]) + data[at + 1 :]
    if kind == 1:  # cut off
        return data[:at]
    if kind == 2:  # a sector of zeros
        return data[:at] + bytes(len(data[at : at + 512])) + data[at + 512 :]
    if kind == 3:  # bytes missing
        return data[:at] + data[at + draw.randrange(1, 64) :]
    if kind == 4:  # a piece twice
        return data[: at + 64] + data[at:]
    return data[:at] + draw.randbytes(draw.randrange(1, 64)) + data[at:]


@pytest.mark.parametrize(
    "command",
    [
        ["log", "info", "{}"],
        ["replay", "{}", "--check"],
        ["log", "export", "{}", "--parquet", "-o", "out.parquet"],
        ["log", "export", "{}", "--mcap", "-o", "out.mcap"],
        ["log", "export", "{}", "--csv", "-o", "out.csv"],
        ["log", "compare", "whole.rrd", "{}"],
        ["view", "{}", "--with", "whole.rrd", "--out", "both.rrd", "--no-show"],
        ["log", "repair", "{}"],
    ],
    ids="-".join,
)
def test_a_damaged_recording(
    command: list[str], counted: bytes, folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    data, draw = counted, random.Random(" ".join(command))
    (folder / "whole.rrd").write_bytes(data)
    good, said = left(*(part.format("whole.rrd") for part in command))
    assert good == 0, said
    found = 0
    capfd.readouterr()
    for number in range(TRIES):
        file = folder / f"damaged{number}.rrd"
        file.write_bytes(damaged(data, draw))
        code, printed = left(*(part.format(file.name) for part in command))
        assert code in (0, 1, 2), printed
        assert "Traceback" not in printed
        assert capfd.readouterr() == ("", "")  # no library writes lines of its own
        if code == 2:
            assert file.name in printed
        found += code == 2 or "is damaged" in printed  # ``log info`` reads what is intact
    assert found or command[:2] == ["log", "repair"]


def test_a_damaged_plan(folder: Path) -> None:
    draw = random.Random("plan")
    plan = min((shipped_folder() / "plans").glob("*.npz"))
    data, kept = plan.read_bytes(), folder / "kept"
    kept.mkdir()
    for number in range(TRIES):
        file = kept / f"damaged{number}.npz"
        file.write_bytes(damaged(data, draw))
        code, printed = left("plan", "--list", "--keep", str(kept), "--json")
        assert code in (0, 2), printed
        assert "Traceback" not in printed
