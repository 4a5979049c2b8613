"""The page for users of Simulink and Drake: its graphs run and do what the formulas say."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.runtime.language.registry import find_block
from aloft.runtime.running.run_result import RunResult

PAGE = (Path(__file__).parents[1] / "docs" / "from_simulink_and_drake.md").read_text("utf-8")


def code(head: str) -> str:
    (found,) = re.findall(rf"```{head}\n(.*?)```", PAGE, re.DOTALL)
    return str(found)


def run(name: str, folder: Path) -> RunResult:
    (folder / f"{name}.yaml").write_text(code(f"yaml {name}"))
    result = aloft.load(folder / f"{name}.yaml").run()
    assert result.success
    return result


def lag_of(time: Any) -> Any:
    return np.where(time >= 1.0, 1.0 - np.exp(-(time - 1.0) / 0.5), 0.0)


def test_every_graph_of_the_page_is_tested() -> None:
    names = re.findall(r"```yaml (\w+)\n", PAGE)
    assert names == ["lag", "rail", "rates", "chart", "swing"]
    assert len(re.findall(r"```yaml", PAGE)) == len(names)


def test_the_lag_is_exact(tmp_path: Path) -> None:
    result = run("lag", tmp_path)
    # a held input: what happens at a tick is seen by a Mealy block in that tick
    assert result.signal("lag.y.value")[:, 0] == pytest.approx(lag_of(result.time), abs=1e-9)


def test_drake_has_the_same_lag() -> None:
    pytest.importorskip("pydrake")
    names: dict[str, Any] = {}
    exec(code("python drake"), names)  # noqa: S102
    log = names["log"].FindLog(names["simulator"].get_context())
    assert log.data()[0] == pytest.approx(lag_of(log.sample_times()), abs=1e-3)


def test_the_mass_on_the_rail_comes_to_its_place(tmp_path: Path) -> None:
    result = run("rail", tmp_path)
    place, force = result.signal("place.y.value")[:, 0], result.signal("pid.u.value")[:, 0]
    assert force[0] == 5.0 and np.abs(force).max() == 5.0  # it is bounded at first
    assert place[-1] == pytest.approx(1.0, abs=0.01)
    assert place.max() < 1.15
    spec = aloft.load(tmp_path / "rail.yaml").checked.block("pid")
    assert str(spec.quantities["u.value"].unit) in ("N", "kg m/s^2", "m kg/s^2")


def test_a_gain_with_a_wrong_unit_is_an_error(tmp_path: Path) -> None:
    text = code("yaml rail").replace("unit: N/m", "unit: N")
    with pytest.raises(aloft.LoadError, match="setpoint and measured must be the same quantity"):
        aloft.load(text, path=tmp_path / "rail.yaml")


def test_the_slower_controller_is_the_difference_equation(tmp_path: Path) -> None:
    result = run("rates", tmp_path)
    y, held = 0.0, 0.0
    expected = []
    share = np.exp(-0.001)
    for tick in range(4000):
        if tick % 10 == 0:
            held = 2.0 * (1.0 - y)
        expected.append(y)
        y = share * y + (1.0 - share) * held
    assert result.signal("plant.y.value")[:, 0] == pytest.approx(expected, abs=1e-12)
    assert expected[-1] == pytest.approx(2.0 / 3.0, abs=1e-3)


def test_the_chart_goes_round(tmp_path: Path) -> None:
    result = run("chart", tmp_path)
    state = result.signal("pump.state.index")
    changes = result.time[1:][np.diff(state) != 0]
    # sin(pi t) > 0.5 from 1/6 s on, < -0.5 from 7/6 s on, every 2 s
    assert changes == pytest.approx([1 / 6, 7 / 6, 13 / 6, 19 / 6], abs=0.011)


def test_the_pendulum_keeps_its_energy(tmp_path: Path) -> None:
    (tmp_path / "pendulum.py").write_text(code("python pendulum"))
    result = run("swing", tmp_path)
    angle = result.signal("pendulum.swing.angle")[:, 0]
    speed = result.signal("pendulum.swing.speed")[:, 0]
    energy = 0.5 * speed**2 - 9.81 * np.cos(angle)
    assert energy == pytest.approx(-9.81 * np.cos(1.0), abs=1e-5)
    # the period of a swing of 1 rad: 2 pi sqrt(l/g) / agm(1, cos(1/2))
    crossings = result.time[1:][(angle[:-1] < 0.0) & (angle[1:] >= 0.0)]
    mean, other = 1.0, np.cos(0.5)
    for _ in range(6):
        mean, other = (mean + other) / 2.0, np.sqrt(mean * other)
    period = 2.0 * np.pi / np.sqrt(9.81) / mean
    assert np.diff(crossings) == pytest.approx([period] * (len(crossings) - 1), abs=0.0101)


def test_every_block_of_the_table_is_there() -> None:
    rows = PAGE.partition("## Which block is which")[2].splitlines()
    names = [
        n
        for row in rows
        if row.startswith("| ")
        for n in re.findall(r"`([\w.]+)`", row.split("|")[3])
    ]
    blocks = [name for name in names if name[0].isupper() or name.startswith("hal.")]
    assert len(blocks) > 40
    for name in blocks:
        assert find_block(name if "." in name else f"blocks.{name}")
