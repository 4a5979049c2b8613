"""A process that takes part in a measurement."""

import os
import time

import pytest

from aloft.benchmarks.other_process import other_process

ECHO = """
import json, os, sys
for line in sys.stdin:
    print(json.dumps([os.getpid(), line.strip()]), flush=True)
"""


def gone(pid: int) -> bool:
    """Whether there is no such process, soon."""
    for _ in range(500):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.01)
    return False


def test_it_answers_and_ends() -> None:
    with other_process(ECHO) as other:
        pid, said = other.ask("one")
        assert said == "one" and other.ask("two") == [pid, "two"]
    assert gone(pid)


def test_it_ends_when_the_measurement_fails_and_when_it_is_frozen() -> None:
    with pytest.raises(ZeroDivisionError), other_process(ECHO) as other:
        pid, _ = other.ask("one")
        other.freeze()
        _ = 1 / 0
    assert gone(pid)
