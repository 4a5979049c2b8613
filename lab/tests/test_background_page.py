"""docs/background.md: its example runs, and says what the schema says."""

import re
from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft import load
from aloft.runtime.loading.reading.graph_file import BackgroundKeys, keys_of

TEXT = (Path(aloft.__file__).parent / "docs" / "background.md").read_text()
FILE = re.compile(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", re.DOTALL)


def test_the_example_runs(tmp_path: Path) -> None:
    pytest.importorskip("casadi")
    for name, text in FILE.findall(TEXT):
        (tmp_path / name).write_text(text)
    result = load(tmp_path / "root.yaml").run()
    assert result.success, result.reason
    sampled = result.signal("wave.y.value")[:480:10, 0]
    root = result.signal("root.y.value")[20::10]
    np.testing.assert_allclose(root**3 + root, sampled, atol=1e-9)
    assert not result.signal("root.y.value")[:20].any()


def test_every_key_has_a_row() -> None:
    for key in keys_of(BackgroundKeys):
        assert f"| `{key}` |" in TEXT
