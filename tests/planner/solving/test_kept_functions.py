"""Functions are derived once, kept, and made anew where what is kept is damaged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from aloft.planner.models.symbolic_model import SymbolicModel
from aloft.planner.problem.stage_functions import StageFunction, derived
from aloft.planner.solving import kept_functions
from aloft.planner.solving.kept_functions import KINDS, FunctionSet, load_functions
from aloft.robots.description import find_robot

PIECES = ("slow", "quick")


@pytest.fixture(autouse=True)
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """An empty cache; what is derived, in its order."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(kept_functions, "_held", {})
    return []


def load(made: list[str], kind: str = "test", **options: Any) -> dict[str, StageFunction]:
    def make(name: str) -> StageFunction:
        made.append(name)
        z, w = ca.SX.sym("z", 2), ca.SX.sym("w")
        return derived(f"test_{name}", z, w, w * z[0] ** 2, ca.vertcat(z[0] * z[1]))

    model: Any = type("Model", (SymbolicModel,), {"__init__": lambda self: None})()
    model.robot, model.loads = find_robot("bruce"), ()
    return load_functions(FunctionSet(kind, PIECES, (), make), model, **options)


def values(pieces: dict[str, StageFunction]) -> list[list[float]]:
    return [[float(v) for v in pieces[name].value([3.0, 2.0], 0.5)] for name in PIECES]


def again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begin as a new process does."""
    monkeypatch.setattr(kept_functions, "_held", {})


def test_once_derived_always_there(made: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    first = load(made)
    assert values(first) == [[4.5, 6.0]] * 2
    assert load(made)["slow"] is first["slow"]
    again(monkeypatch)
    second = load(made)
    assert values(second) == [[4.5, 6.0]] * 2
    assert made == list(PIECES)
    for name in PIECES:
        for kind in KINDS:
            ours, kept = (getattr(pieces[name], kind) for pieces in (first, second))
            assert kept.name() == ours.name() == f"test_{name}_{kind}"
            assert all(map(np.array_equal, kept.arrays(), ours.arrays()))


def test_only_the_sets_asked_for_last_are_held(made: list[str]) -> None:
    """A process that plans for one robot after another does not grow with every one."""
    first = load(made, "set_0")
    for number in range(1, kept_functions.KEPT):
        load(made, f"set_{number}")
    assert load(made, "set_0")["slow"] is first["slow"]
    load(made, "one_more")  # in place of set 1, for which nobody has asked since
    assert len(kept_functions._held) == kept_functions.KEPT
    assert load(made, "set_0")["slow"] is first["slow"]
    made.clear()
    assert values(load(made, "set_1")) == values(first) and made == []  # read from the disk


def test_progress_names_what_is_derived(made: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[str, int, int]] = []
    load(made, progress=lambda *each: told.append(each))
    ready = ("test functions ready", 2, 2)
    assert told == [
        ("deriving the test slow functions", 0, 2), ("deriving the test quick functions", 1, 2), ready,
    ]  # fmt: skip
    again(monkeypatch)
    told.clear()
    load(made, progress=lambda *each: told.append(each))
    assert told == [ready]


def test_a_cache_that_cannot_be_written_is_done_without(
    made: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert values(load(made)) == [[4.5, 6.0]] * 2


@pytest.mark.parametrize("damage", ["empty", "bit", "cut", "exchanged"])
def test_what_is_damaged_is_derived_anew(
    damage: str, made: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    load(made)
    folder = kept_functions.FUNCTIONS.folder
    assert folder is not None
    quick, slow = (next(folder.rglob(f"{name}.npz")) for name in ("quick", "slow"))
    whole = quick.read_bytes()
    quick.write_bytes(
        {
            "empty": b"",
            "bit": whole[:300] + bytes([whole[300] ^ 1]) + whole[301:],
            "cut": whole[:-40],
            "exchanged": slow.read_bytes(),
        }[damage]
    )
    again(monkeypatch)
    made.clear()
    assert values(load(made)) == [[4.5, 6.0]] * 2
    assert made == ["quick"]
