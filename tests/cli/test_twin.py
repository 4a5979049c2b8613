"""``aloft twin`` serves until it is told to end, whether or not somebody reads what it sends."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_at_a_signal_while_nobody_reads_its_packets(
    tmp_path: Path, number: signal.Signals
) -> None:
    file = tmp_path / "twin.yaml"
    command = [sys.executable, "-m", "aloft", "twin", "--out", str(file), "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path)
    try:
        assert process.stdout is not None
        text = ""
        while not text.rstrip().endswith("}"):
            line = process.stdout.readline()
            assert line, "the twin has ended"
            text += line
        ports = json.loads(text)
        hardware = yaml.safe_load(file.read_text())
        assert hardware["bus"]["port"] == ports["bus"] and Path(ports["board"]).exists()
        time.sleep(1.0)  # the board's packets fill the terminal's buffer
        process.send_signal(number)
        assert process.wait(60.0) == 0
    finally:
        process.kill()
        process.wait()
