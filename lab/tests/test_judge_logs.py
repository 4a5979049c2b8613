"""Logs that are drawn play what pandas, NumPy and SciPy say; see ``lab/judge_logs.py``."""

from __future__ import annotations

import pytest

from aloft.lab.judge_logs import judge

for library in ("pandas", "scipy", "h5py", "rosbags"):
    pytest.importorskip(library)


def test_drawn_logs_play_what_pandas_and_numpy_say() -> None:
    tally = judge(8, seed=51)
    assert not tally.wrong, tally.wrong[0]
    assert tally.counts["right"] >= 5, tally


@pytest.mark.long
def test_more_drawn_logs_and_graphs_of_them() -> None:
    tally = judge(120, seed=52, graphs=40)
    assert not tally.wrong, tally.wrong[0]
    assert tally.counts["right"] >= 80 and tally.counts["refused, as is right"] >= 10, tally
    assert tally.counts["graphs"] >= 2, tally
