"""Logs as other people's loggers write them are imported and played as they are meant, or refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from aloft import load
from aloft.cli.log_import import guess, import_log, of_axes
from aloft.cli.logged_joints import columns_of_joints
from aloft.logs.recording.recorder import Recorder
from aloft.robots.description import find_robot

START, STEP, ROWS = 1_700_000_000, 0.005, 60
TIMES = STEP * np.arange(ROWS)
JOINTS = [joint.name for joint in find_robot("bruce").joints]
ANGLES = 0.1 * np.sin(np.outer(TIMES, np.arange(1, 11)))
RATES = 0.2 * np.sin(np.outer(TIMES, [1.0, 2.0, 3.0]) + 1.0)
FORCES = np.array([0.0, 0.0, 9.8]) + 0.1 * RATES


def imu(rate: str, force: str, axes: str) -> dict[str, Any]:
    return {rate + axis: RATES[:, k] for k, axis in enumerate(axes)} | {force + axis: FORCES[:, k] for k, axis in enumerate(axes)}  # fmt: skip


def angles(name: str) -> dict[str, Any]:
    return {name.format(joint): ANGLES[:, k] for k, joint in enumerate(JOINTS)}


def pandas_dates(folder: Path, pandas: Any) -> Path:
    index = pandas.to_datetime(START * 10**9 + (TIMES * 1e9).astype(np.int64))
    frame = pandas.DataFrame(imu("gyro_", "acc_", "xyz") | angles("{}_pos"), index=index)
    frame.to_csv(folder / "log.csv")
    return folder / "log.csv"


def pandas_index(folder: Path, pandas: Any) -> Path:
    own = {"t": START + TIMES} | imu("w", "a", "xyz") | angles("{}.position")
    pandas.DataFrame(own).to_csv(folder / "log.csv")
    return folder / "log.csv"


def parquet_with_missing_values(folder: Path, pandas: Any) -> Path:
    frame = pandas.DataFrame(imu("gyro_", "acc_", "xyz") | angles("{}_pos")).convert_dtypes()
    frame["mode"] = pandas.array([1, None] * (ROWS // 2), dtype="Int64")
    frame["time"] = pandas.to_datetime(START * 10**9 + (TIMES * 1e9).astype(np.int64))
    frame.set_index("time").to_parquet(folder / "log.parquet")
    return folder / "log.parquet"


def plotjuggler(folder: Path, pandas: Any) -> Path:
    """Write topics one below the other: each has numbers in its own rows, those of joints 1 ms later and half as often."""
    moving = pandas.DataFrame({"__time": START + TIMES} | imu("/imu/data/angular_velocity/", "/imu/data/linear_acceleration/", "xyz"))  # fmt: skip
    turned = pandas.DataFrame({"__time": START + TIMES} | angles("/joint_states/{}/position"))[::2]
    turned["__time"] += 0.001
    pandas.concat([moving, turned]).sort_values("__time").to_csv(folder / "log.csv", index=False)
    return folder / "log.csv"


def ardupilot(folder: Path, pandas: Any) -> Path:
    own = {"TimeUS": 12_345_678 + (TIMES * 1e6).astype(int), "I": 0} | imu("Gyr", "Acc", "XYZ") | {"T": 45.2}  # fmt: skip
    pandas.DataFrame(own).to_csv(folder / "IMU.csv", index=False)
    return folder / "IMU.csv"


def px4(folder: Path, pandas: Any) -> Path:
    own: dict[str, Any] = {"timestamp": 12_345_678 + (TIMES * 1e6).astype(int)}
    own |= {f"gyro_rad[{k}]": RATES[:, k] for k in range(3)}
    own |= {"gyro_integral_dt": 5000, "accelerometer_timestamp_relative": 0}
    own |= {f"accelerometer_m_s2[{k}]": FORCES[:, k] for k in range(3)}
    pandas.DataFrame(own).to_csv(folder / "log_sensor_combined_0.csv", index=False)
    return folder / "log_sensor_combined_0.csv"


def matlab_structures(folder: Path, pandas: Any) -> Path:
    """Write a structure for each quantity, with stamps of its own, and columns x 1 x rows."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "log.mat", "w", userblock_size=512) as file:
        for name, values in {"joints_state/positions": ANGLES, "gyros/imu": RATES, "accelerometers/imu": FORCES}.items():  # fmt: skip
            late = 0.001 if name.startswith("joints") else 0.0
            file[f"logger/{name}/data"] = values[:, None, :]
            file[f"logger/{name}/dimensions"] = np.array([[values.shape[1]], [1.0], [ROWS]])
            file[f"logger/{name}/timestamps"] = (START + TIMES + late)[:, None]
        cells = file.create_dataset("logger/joints_state/positions/elements_names", (1, len(JOINTS)), dtype=h5py.ref_dtype)  # fmt: skip
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
        for k, joint in enumerate(JOINTS):
            text = file.create_dataset(f"#refs#/{k}", data=np.array([[ord(each)] for each in joint], np.uint16))  # fmt: skip
            text.attrs["MATLAB_class"] = np.bytes_("char")
            cells[0, k] = text.ref
    return folder / "log.mat"


LATE: dict[Callable[[Path, Any], Path], float] = {plotjuggler: 0.001, matlab_structures: 0.001}
"""Of the joints' stamps behind the IMU's [s]."""


@pytest.mark.long
@pytest.mark.parametrize(
    "write",
    [pandas_dates, pandas_index, parquet_with_missing_values, plotjuggler, ardupilot, px4, matlab_structures],
)  # fmt: skip
def test_a_log_is_played_as_it_is_meant(
    tmp_path: Path, write: Callable[[Path, Any], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    graph = tmp_path / "graph.yaml"
    import_log(write(tmp_path, pytest.importorskip("pandas")), Path("bruce"), graph, as_json=True)
    assert "clock.even" not in capsys.readouterr().out, "stamps are no arrival times"
    result = load(graph).run()
    late = LATE.get(write, 0.0)
    ticks = late + 0.002 * np.arange(len(result.signal("robot.health.stamp")))
    ticks = ticks[ticks < TIMES[-4]]
    for name, meant, after in (
        ("imu.angular_velocity", RATES, 0.0), ("imu.specific_force", FORCES, 0.0), ("joints.position", ANGLES, late),
    ):  # fmt: skip
        if name.startswith("joints") and write in (ardupilot, px4):
            continue
        found = result.signal(f"robot.{name}")[: len(ticks)]
        right = np.stack([np.interp(ticks - after, TIMES, each) for each in meant.T], axis=1)
        # half of the rows, and stamps in seconds since 1970 that floats round
        assert np.abs(found - right).max() < (1e-4 if write is plotjuggler else 1e-6), name


@pytest.mark.parametrize(
    ("names", "series"),
    [
        (["GyrX", "GyrY", "GyrZ"], {"Gyr": ["GyrX", "GyrY", "GyrZ"]}),
        (["q.w", "q.z", "q.y", "q.x"], {"q": ["q.x", "q.y", "q.z", "q.w"]}),
        (["acc_x_raw", "acc_y_raw", "acc_z_raw"], {"acc_raw": ["acc_x_raw", "acc_y_raw", "acc_z_raw"]}),
        (["gyro (x)", "gyro (y)", "gyro (z)"], {"gyro)": ["gyro (x)", "gyro (y)", "gyro (z)"]}),
        (["wx", "wy"], {}),
        (["max", "may", "maz", "ma"], {}),  # the name is taken
    ],
)  # fmt: skip
def test_columns_of_axes(names: list[str], series: dict[str, list[str]]) -> None:
    assert of_axes(dict.fromkeys(names, 1)) == series


def test_three_columns_of_axes_are_no_joints() -> None:
    widths = dict.fromkeys(["t", "pos_x", "pos_y", "pos_z", "wx", "wy", "wz"], 1)
    assert guess(widths) == {"time": "t", "angular_velocity": ["wx", "wy", "wz"]}


@pytest.mark.parametrize(("step", "unit"), [(5000, "us"), (20, "ms"), (2_000_000, "ns"), (0.01, None)])  # fmt: skip
def test_the_unit_of_stamps_is_guessed_by_their_steps(
    tmp_path: Path, step: float, unit: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = "".join(f"{k * step},0,0,{k % 2},0,0,9.8\n" for k in range(9))
    (tmp_path / "log.csv").write_text("stamp,wx,wy,wz,ax,ay,az\n" + rows)
    import_log(tmp_path / "log.csv", None, tmp_path / "graph.yaml")
    clock = yaml.safe_load((tmp_path / "graph.yaml").read_text())["blocks"]["robot"]["with"]["clock"]  # fmt: skip
    assert clock == {"stamps": "stamp"} | ({"unit": unit} if unit else {})
    assert ("rows a second (clock.unit)" in capsys.readouterr().out) == (unit is not None)


@pytest.mark.parametrize(
    ("late", "missing", "even"),
    [(0.0, 0, False), (0.5, 0, True), (0.0, 150, False), (0.5, 150, False)],
)
def test_only_arrival_times_of_all_rows_get_an_even_grid(
    tmp_path: Path, late: float, missing: int, even: bool
) -> None:
    chance, rows = np.random.default_rng(0), np.arange(400)
    stamps = 0.01 * (rows + late * chance.random(400))
    stamps[100:] += 0.01 * missing
    table = np.column_stack([stamps, *RATES[rows % ROWS].T, *FORCES[rows % ROWS].T])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t,wx,wy,wz,ax,ay,az")
    import_log(tmp_path / "log.csv", None, tmp_path / "graph.yaml")
    clock = yaml.safe_load((tmp_path / "graph.yaml").read_text())["blocks"]["robot"]["with"]["clock"]  # fmt: skip
    assert clock.get("even", False) == even


def test_what_was_measured_comes_before_what_was_computed_or_known() -> None:
    widths = {
        "estimator.base.angular_velocity": 3, "ahead.joints.position": 10, "robot.truth.joint_position": 10,
        "dynamics.terms.base_position": 3, "robot.imu.angular_velocity": 3, "robot.imu.specific_force": 3,
        "plan.reference.joint_torque": 10, "robot.joints.position": 10, "robot.joints.torque": 10,
        "robot.truth.base_position": 3, "dynamics.terms.base_orientation": 4, "robot.truth.base_orientation": 4,
    }  # fmt: skip
    assert guess(widths, joints=[10]) == {
        "angular_velocity": "robot.imu.angular_velocity", "specific_force": "robot.imu.specific_force",
        "joint_position": "robot.joints.position", "joint_torque": "robot.joints.torque",
        "truth_position": "robot.truth.base_position", "truth_quaternion": "robot.truth.base_orientation",
    }  # fmt: skip
    single = {f"{name}[{joint}]": 1 for name in ("ahead.position", "robot.position") for joint in JOINTS}  # fmt: skip
    found = columns_of_joints(single, find_robot("bruce"), "robot.imu.specific_force[x]")
    assert found["position"] == [f"robot.position[{joint}]" for joint in JOINTS]


@pytest.mark.long
def test_a_recording_of_aloft_is_imported_whole(tmp_path: Path) -> None:
    load("aloft:jump.yaml").run(sinks=[Recorder(tmp_path / "jump.rrd")], log=False, run_hash=False)
    graph = tmp_path / "graph.yaml"
    import_log(tmp_path / "jump.rrd", Path("bruce"), graph, as_json=True)
    played = yaml.safe_load(graph.read_text())["blocks"]["robot"]["with"]
    closed = {foot: given["closed"] for foot, given in played["contacts"].items()}
    assert sorted(closed["left_foot"] + closed["right_foot"]) == [
        f"robot.contacts.closed[{k}]" for k in range(4)
    ]
    result = load(graph).run()
    assert result.metrics["estimator_flights"] == 1
    assert float(result.metrics["estimator_position_rms_m"]) < 0.01
    assert not result.block_warnings
