"""Drawn logs as files, by the writers of NumPy, h5py, Arrow and rosbags, and the parameters that name what is in them."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ..robots.description import find_robot
from .drawn_logs import BAGS, RECORDED, DrawnLog, Numbers, Quantity

FLAWS = {
    "column": "has no column", "unit": "expected a unit like", "text": "is text", "lost": "expected at least 2|is empty",
    "width": " columns, expected ", "unit's name": "unit of ", "joint": "has no joint ", "foot": "has no foot ",
    "complex": "complex numbers", "one row": "has one row", "deep": "has 3 dimensions",
}  # fmt: skip
"""Parts of the text that each mistake must have: one of them."""
FIELDS = {
    "imu.angular_velocity": "imu_data.angular_velocity", "imu.specific_force": "imu_data.linear_acceleration",
    "joints.position": "joint_states.position", "joints.velocity": "joint_states.velocity", "joints.torque": "joint_states.effort",
    "truth.position": "mocap_pose.pose.position", "truth.quaternion": "mocap_pose.pose.orientation",
}  # fmt: skip
"""Fields of messages, by quantity."""


def save(drawn: DrawnLog, folder: Path) -> dict[str, Any]:
    """Write a drawn log; return the parameters of a LogRobot that plays it."""
    chance = np.random.default_rng((drawn.seed, 1))
    bag = drawn.kind in BAGS
    writer = _recording if drawn.played is not None else _bag if bag else _arrays
    file, specs, names = writer(drawn, folder, chance)
    params: dict[str, Any] = {**drawn.params, "file": str(file)}
    for key, flaw in drawn.flaws.items():
        if key not in specs:
            continue
        columns = specs[key]["columns"]
        specs[key] = {
            "lost": ["odd_lost"] * drawn.quantities[key].raw.shape[1],
            "width": [columns, columns] if isinstance(columns, str) else columns * 2,
            "column": misspelt(columns)
            if isinstance(columns, str)
            else [misspelt(columns[0]), *columns[1:]],
            "unit": {**specs[key], "unit": "kg"},
            "unit's name": {**specs[key], "unit": "furlongs"},
            "text": "joint_states.name" if bag else "odd_text",
        }.get(flaw, f"odd_{flaw.replace(' ', '_')}")
    for key, spec in specs.items():
        group, _, part = key.partition(".")
        given = params[group] = dict(params.get(group, {}))
        if group == "contacts":
            foot, _, part = part.rpartition(".")
            given[foot] = {part: spec}
            if part == "force":
                given[foot] |= {"closes": 25.0, "opens": -5.0}
        else:
            given[part] = spec
    if "joints" in params:
        params["joints"]["names"] = names or drawn.joints
    if "joints.names" in drawn.flaws:
        own = {joint.name for joint in find_robot("bruce").joints}
        named = list(drawn.joints)
        wrong = next(k for k, name in enumerate(named) if name in own)
        named[wrong] += "e"
        params["joints"]["names"] = named
    if "contacts" in drawn.flaws:
        params["contacts"] = {f"{foot}t": given for foot, given in params["contacts"].items()}
    if "truth.quaternion" in specs and not bag:
        params["truth"]["order"] = drawn.order
    if not any(key.startswith("imu") for key in specs):
        params.pop("imu", None)
    return params


def misspelt(column: str) -> str:
    """Return a column's name with a letter too many; an index stays behind it."""
    name, bracket, index = column.partition("[")
    return f"{name}e{bracket}{index}"


def _recording(
    drawn: DrawnLog, folder: Path, chance: np.random.Generator
) -> tuple[Path, dict[str, Any], str | None]:
    """Run a graph whose robot is a log, and record it; what its ports had becomes what is meant."""
    from .. import load
    from ..logs.recording.recorder import Recorder

    assert drawn.played is not None
    (folder / "played").mkdir()
    params = save(drawn.played, folder / "played")
    graph = {"rate": f"{1.0 / drawn.played.period:g} Hz", "robot": "bruce",
             "blocks": {"robot": {"use": "hal.LogRobot", "with": params}}}  # fmt: skip
    checked, robot = load(graph), find_robot("bruce")
    run = checked.run(sinks=[Recorder(folder / "log.rrd")], run_hash=False)
    feet = [foot.name for foot in robot.feet]
    specs: dict[str, Any] = {}
    for key in drawn.quantities:
        if key in RECORDED:
            columns: str | list[str] = f"robot.{RECORDED[key]}"
            values = run.signal(f"robot.{RECORDED[key]}")
        else:
            foot = feet.index(key.split(".")[1])
            points = [k for k, owner in enumerate(robot.foot_of_contact()) if owner == foot]
            columns = [f"robot.contacts.closed[{point}]" for point in points]
            values = run.signal("robot.contacts.closed")[:, points]
        drawn.quantities[key] = Quantity(values)
        specs[key] = _spec(columns, drawn.quantities[key])
    drawn.stamps = dict.fromkeys(("imu", "joints", "contacts", "truth"), drawn.played.period * np.arange(len(values)))  # fmt: skip
    return folder / "log.rrd", specs, None


def _spec(columns: Any, quantity: Quantity, told: bool = False) -> dict[str, Any]:
    """Return how a parameter names columns; ``told`` is whether the file says their unit."""
    spec: dict[str, Any] = {"columns": columns}
    if quantity.unit and not told:
        spec["unit"] = quantity.unit
    if set(quantity.scale) != {1.0}:
        spec["scale"] = quantity.scale
    if any(quantity.offset):
        spec["offset"] = quantity.offset
    return spec


def _arrays(
    drawn: DrawnLog, folder: Path, chance: np.random.Generator
) -> tuple[Path, dict[str, Any], str | None]:
    """Write a file that has arrays, or columns, with one clock."""
    raw = {key: quantity.raw for key, quantity in drawn.quantities.items()}
    if "truth.quaternion" in raw and drawn.order == "wxyz":
        raw["truth.quaternion"] = raw["truth.quaternion"][:, [3, 0, 1, 2]]
    stamps = drawn.stamps["imu"]
    clock = drawn.params["clock"]
    if drawn.kind in ("csv", "parquet"):
        save_table = _csv if drawn.kind == "csv" else _parquet
        return save_table(drawn, folder, chance, raw, stamps)
    if "stamps" in clock:
        clock["unit"] = drawn.unit
    rows = len(stamps)
    odd = {"odd_complex": np.ones(rows, complex), "odd_one_row": np.ones((1, 1)), "odd_deep": np.ones((rows, 3, 3)),
           "odd_lost": np.full(rows, np.nan), "odd_text": np.array(["a", "b"])}  # fmt: skip
    arrays: dict[str, Numbers] = {}
    for name, values in {"t": stamps, **raw}.items():
        way = int(chance.integers(4))
        if drawn.kind == "mat" or way == 1:
            values = np.asfortranarray(values).T
        if way == 2 and values.dtype.kind != "b":
            values = values.astype(values.dtype.newbyteorder(">"))
        if way == 3 and values.ndim == 2:
            values = np.asfortranarray(values)
        if values.ndim == 2 and values.shape[0] == values.shape[1]:
            values = raw[name]
        if chance.random() < 0.3:  # as MATLAB's and robots' loggers write them
            values = np.expand_dims(values, int(chance.integers(values.ndim + 1)))
        arrays[name] = values
    names = "joint_names" if drawn.joints and chance.random() < 0.5 else None
    file = folder / f"log.{drawn.kind}"
    if drawn.kind == "npz":
        saver: Any = np.savez if chance.random() < 0.5 else np.savez_compressed
        saver(file, **arrays, **odd, joint_names=np.array(drawn.joints or ["none"]))
    else:
        _hdf5(file, arrays | odd, drawn, chance)
    specs = {key: _spec(key, quantity) for key, quantity in drawn.quantities.items()}
    return file, specs, names


def _hdf5(file: Path, arrays: dict[str, Numbers], drawn: DrawnLog, chance: Any) -> None:
    h5py = import_module("h5py")
    matlab = drawn.kind == "mat"
    with h5py.File(file, "w", userblock_size=512 if matlab else 0) as out:
        for name, values in arrays.items():
            if name == "odd_text":
                out.create_dataset(name, data=["a", "b"], dtype=h5py.string_dtype())
                continue
            packed = {"chunks": True, "compression": "gzip"} if chance.random() < 0.3 else {}
            each = np.atleast_2d(values) if matlab else values
            made = out.create_dataset(name, data=each, **packed)
            if matlab:
                made.attrs["MATLAB_class"] = np.bytes_("double")
        joints = drawn.joints or ["none"]
        if not matlab:
            out.create_dataset("joint_names", data=joints, dtype=h5py.string_dtype())
            return
        cells = out.create_dataset("joint_names", (1, len(joints)), dtype=h5py.ref_dtype)
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
        for k, joint in enumerate(joints):
            codes = np.array([[ord(letter)] for letter in joint], np.uint16)
            text = out.create_dataset(f"#refs#/{k}", data=codes)
            text.attrs["MATLAB_class"] = np.bytes_("char")
            cells[0, k] = text.ref


def _columns(drawn: DrawnLog, raw: dict[str, Numbers]) -> dict[str, list[str]]:
    return {
        key: [f"{key.replace('.', '_')}{k}" for k in range(values.shape[1])]
        for key, values in raw.items()
    }


def _csv(
    drawn: DrawnLog, folder: Path, chance: np.random.Generator, raw: dict[str, Numbers], stamps: Numbers
) -> tuple[Path, dict[str, Any], str | None]:  # fmt: skip
    separator = str(chance.choice([",", ";", "\t"]))
    comma = separator != "," and chance.random() < 0.5
    told = str(chance.choice(["no", "brackets", "round", "row"]))
    nothing = str(chance.choice(["", "nan", "NaN"]))
    columns = _columns(drawn, raw)
    units = {"t": drawn.unit}
    table: dict[str, list[Any]] = {"t": stamps.tolist()}
    for key, names in columns.items():
        for k, name in enumerate(names):
            table[name] = raw[key][:, k].tolist()
            units[name] = drawn.quantities[key].unit
    rows = len(stamps)
    table["odd_text"] = [f"row {k}" for k in range(rows)]
    table["odd_lost"] = [np.nan] * rows
    titles: Any = {
        "brackets": lambda name: f"{name} [{units[name]}]" if units.get(name) else name,
        "round": lambda name: f"{name} ({units[name]})" if units.get(name) else name,
    }.get(told, lambda name: name)

    def text(value: Any) -> str:
        if isinstance(value, float):
            written = nothing if np.isnan(value) else repr(value)
            return written.replace(".", ",") if comma else written
        return f'"{value}"' if isinstance(value, str) else str(value)

    lines = ["# a log", "# of a robot"] if chance.random() < 0.3 else []
    lines.append(separator.join(titles(name) for name in table))
    if told == "row":
        lines.append(separator.join(units.get(name, "") for name in table))
    lines += [separator.join(map(text, row)) for row in zip(*table.values(), strict=True)]
    if chance.random() < 0.2:
        lines.insert(len(lines) // 2, "# a remark")
    file = folder / "log.csv"
    end = str(chance.choice(["\n", "\r\n"]))
    mark = "\ufeff" if chance.random() < 0.2 else ""
    file.write_bytes((mark + end.join(lines) + end).encode())
    if "stamps" in drawn.params["clock"] and told == "no":
        drawn.params["clock"]["unit"] = drawn.unit
    return file, {key: _spec(columns[key], each, told != "no") for key, each in drawn.quantities.items()}, None  # fmt: skip


def _parquet(
    drawn: DrawnLog, folder: Path, chance: np.random.Generator, raw: dict[str, Numbers], stamps: Numbers
) -> tuple[Path, dict[str, Any], str | None]:  # fmt: skip
    pa, pq = import_module("pyarrow"), import_module("pyarrow.parquet")
    lists = chance.random() < 0.4
    moments = drawn.unit == "ns" and stamps.dtype == np.int64 and chance.random() < 0.5
    table = {"t": pa.array(stamps, pa.timestamp("ns") if moments else None)}
    columns: dict[str, Any] = {key: key.replace(".", "_") for key in raw} if lists else _columns(drawn, raw)  # fmt: skip
    for key, values in raw.items():
        if lists:
            table[columns[key]] = pa.array(values.tolist())
            continue
        for k, name in enumerate(columns[key]):
            table[name] = pa.array(values[:, k], from_pandas=chance.random() < 0.5)
    table["odd_text"] = pa.array(["a"] * len(stamps))
    table["odd_lost"] = pa.array([None] * len(stamps), pa.float64())
    file = folder / "log.parquet"
    pq.write_table(
        pa.table(table), file, compression=str(chance.choice(["snappy", "zstd", "none"]))
    )
    if "stamps" in drawn.params["clock"] and not moments:
        drawn.params["clock"]["unit"] = drawn.unit
    return file, {key: _spec(columns[key], each) for key, each in drawn.quantities.items()}, None


def _topics(drawn: DrawnLog, kinds: Any) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the topic, type and maker of messages of each group or quantity, and the field of each quantity."""
    vector, point = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Point"]
    four, nothing, none = kinds["geometry_msgs/msg/Quaternion"], np.zeros(9), np.zeros(0)
    raw = {key: quantity.raw for key, quantity in drawn.quantities.items()}

    def imu(head: Any, k: int) -> Any:
        return kinds["sensor_msgs/msg/Imu"](
            head, four(0.0, 0.0, 0.0, 1.0), nothing, vector(*raw["imu.angular_velocity"][k].tolist()), nothing,
            vector(*raw["imu.specific_force"][k].tolist()), nothing,
        )  # fmt: skip

    def joints(head: Any, k: int) -> Any:
        parts = [raw[f"joints.{part}"][k].astype(float) if f"joints.{part}" in raw else none for part in ("position", "velocity", "torque")]  # fmt: skip
        return kinds["sensor_msgs/msg/JointState"](head, drawn.joints, *parts)

    def pose(head: Any, k: int) -> Any:
        where = point(*raw["truth.position"][k].tolist())
        turn = four(*raw["truth.quaternion"][k].tolist())
        return kinds["geometry_msgs/msg/PoseStamped"](head, kinds["geometry_msgs/msg/Pose"](where, turn))  # fmt: skip

    def one_vector(key: str) -> Any:
        return lambda head, k: kinds["geometry_msgs/msg/Vector3Stamped"](head, vector(*raw[key][k].tolist()))  # fmt: skip

    def wrench(key: str) -> Any:
        def make(head: Any, k: int) -> Any:
            pushed = kinds["geometry_msgs/msg/Wrench"](vector(1.0, 2.0, float(raw[key][k, 0])), vector(3.0, 4.0, 5.0))  # fmt: skip
            return kinds["geometry_msgs/msg/WrenchStamped"](head, pushed)

        return make

    def switch(key: str) -> Any:
        return lambda head, k: kinds["std_msgs/msg/Bool"](bool(raw[key][k, 0]))

    fields = dict(FIELDS)
    makers: dict[str, Any] = {}
    if "imu.angular_velocity" in drawn.stamps:
        for key, part in (("imu.angular_velocity", "gyro"), ("imu.specific_force", "accel")):
            makers[key] = (f"/imu/{part}", "geometry_msgs/msg/Vector3Stamped", one_vector(key))
            fields[key] = f"imu_{part}.vector"
    else:
        makers["imu"] = ("/imu/data", "sensor_msgs/msg/Imu", imu)
    makers["joints"] = ("/joint_states", "sensor_msgs/msg/JointState", joints)
    makers["truth"] = ("/mocap/pose", "geometry_msgs/msg/PoseStamped", pose)
    for key in raw:
        foot = key.split(".")[1]
        if key.endswith(".force"):
            makers[key] = (f"/{foot}/wrench", "geometry_msgs/msg/WrenchStamped", wrench(key))
            fields[key] = f"{foot}_wrench.wrench.force[2]"
        elif key.endswith(".closed"):  # without a header: its arrival counts
            makers[key] = (f"/{foot}/closed", "std_msgs/msg/Bool", switch(key))
            fields[key] = f"{foot}_closed.data"
    return makers, fields


def _bag(
    drawn: DrawnLog, folder: Path, chance: np.random.Generator
) -> tuple[Path, dict[str, Any], str | None]:
    """Write a bag, whose topics have clocks of their own; arrivals are late."""
    rosbag2, typesys = import_module("rosbags.rosbag2"), import_module("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kinds, plugin = store.types, rosbag2.StoragePlugin
    stamp, header = kinds["builtin_interfaces/msg/Time"], kinds["std_msgs/msg/Header"]
    makers, fields = _topics(drawn, kinds)
    way = plugin.SQLITE3 if drawn.kind == "bag" and chance.random() < 0.5 else plugin.MCAP
    writer = rosbag2.Writer(folder / "bag", version=9, storage_plugin=way)
    packed = chance.choice(["no", "message", "file"]) if drawn.kind == "bag" and way == plugin.SQLITE3 else "no"  # fmt: skip
    if packed != "no":
        writer.set_compression(
            rosbag2.CompressionMode.MESSAGE
            if packed == "message"
            else rosbag2.CompressionMode.FILE,
            rosbag2.CompressionFormat.ZSTD,
        )
    messages = []
    with writer:
        for group, (topic, kind, make) in makers.items():
            if not any(key.startswith(group) for key in drawn.quantities):
                continue
            connection = writer.add_connection(topic, kind, typestore=store)
            counts = drawn.stamps_of(group)
            late = 0 if group.endswith(".closed") else chance.integers(0, 10**7, len(counts))
            order = np.arange(len(counts))
            arrivals = np.maximum.accumulate(counts + late - order) + order
            if group.endswith(".closed"):
                drawn.stamps[group] = arrivals
            for k, (count, arrival) in enumerate(zip(counts.tolist(), arrivals.tolist(), strict=True)):  # fmt: skip
                head = header(stamp=stamp(sec=count // 10**9, nanosec=count % 10**9), frame_id="base")  # fmt: skip
                messages.append((arrival, connection, store.serialize_cdr(make(head, k), kind)))
        if chance.random() < 0.5:  # topics that are nobody's
            for topic, kind, data in (
                ("/battery", "std_msgs/msg/Float32", kinds["std_msgs/msg/Float32"](24.0)),
                ("/log", "std_msgs/msg/String", kinds["std_msgs/msg/String"]("a word")),
            ):
                connection = writer.add_connection(topic, kind, typestore=store)
                for arrival in sorted(chance.choice([each[0] for each in messages], 5)):
                    messages.append((int(arrival), connection, store.serialize_cdr(data, kind)))
        if chance.random() < 0.5:  # topics arrive in turns, as they do
            messages.sort(key=lambda each: each[0])
        for arrival, connection, data in messages:
            writer.write(connection, arrival, data)
    found = folder / "bag"
    file = next(found.glob("*.mcap")) if drawn.kind == "mcap" else found
    specs = {key: _spec(fields[key], each) for key, each in drawn.quantities.items()}
    return file, specs, "joint_states.name" if drawn.joints and chance.random() < 0.5 else None
