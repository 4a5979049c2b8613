"""Files that are no logs, or are written as nobody should: read right, or refused with a text that says what and where."""

from __future__ import annotations

import gzip
import warnings
from pathlib import Path

import numpy as np
import pytest

from aloft.hal.log.log_file import LogError, read_log


def csv(folder: Path, text: str | bytes, name: str = "log.csv") -> Path:
    file = folder / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def column(file: Path, name: str) -> list[float]:
    return read_log(file).array(name).values[:, 0].tolist()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t;q\n0,5;1,25\n1,5;2,25\n", [1.25, 2.25]),
        ("t\tq\r\n0.5\t1.25\r\n1.5\t2.25\r\n", [1.25, 2.25]),
        ("# of a robot, by hand\n\nt,q\n0,1\n# here it fell\n1,2\n", [1.0, 2.0]),
        ("# t,q\n0,1\n1,2\n", [1.0, 2.0]),
        ("t,q\n0,True\n1,false\n", [1.0, 0.0]),
        ("t,q,\n0,1,\n1,2,\n", [1.0, 2.0]),
        ('\ufefft,"q"\n0, 1.5 \n1,+2e0\n', [1.5, 2.0]),
        ("t,q\n0,1\n1,\n2,nan\n3,4\n", [1.0, np.nan, np.nan, 4.0]),
        ("t,q\ns,\n0,1\n1,2\n", [1.0, 2.0]),
    ],
)
def test_tables_as_people_write_them(tmp_path, text, expected):
    assert column(csv(tmp_path, text), "q") == pytest.approx(expected, nan_ok=True)


def test_brackets_have_a_unit_or_belong_to_the_name(tmp_path):
    file = csv(
        tmp_path,
        "t [ms],q[0],q[1],gyro (x),gyro (y),w (\xb0/s),a [g],v [furlongs]\n".encode("latin-1")
        + b"1,2,3,4,5,6,7,8\n" * 2,
    )
    log = read_log(file)
    assert list(log.arrays) == ["t", "q[0]", "q[1]", "gyro (x)", "gyro (y)", "w", "a", "v [furlongs]"]  # fmt: skip
    units = [log.arrays[name].unit for name in log.arrays]
    assert units == ["ms", None, None, None, None, "deg/s", "g", "furlongs"]
    below = csv(tmp_path, "t,w,a\n[us],[rpm],[m/s2]\n1,2,3\n2,3,4\n", "below.csv")
    assert [each.unit for each in read_log(below).arrays.values()] == ["us", "rpm", "m/s^2"]


def test_dates_are_stamps_without_rounding(tmp_path):
    file = csv(tmp_path, "t,q\n2026-11-29 11:05:00.000000001,1\n2026-11-29 11:05:00.000000003,2\n")
    array = read_log(file).array("t")
    assert array.unit == "ns" and array.whole is not None and np.diff(array.whole) == [2]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "log.csv has no rows"),
        ("t,q\n", "log.csv has no rows"),
        ("t,q\n0,1\n", "log.csv has no columns of numbers; t has one row; q has one row"),
        ("1,2\n3,4\n", "the first line must have the columns' names"),
        ("t q\n0 1\n1 2\n", "columns are apart by spaces, expected commas, semicolons or tabs"),
        ("t,q\n0,1\n1\n", "line 3 has 1 values, and the header 2 names"),
        ("t,q\n0,1,5\n1,2,5\n", "line 2 has 3 values, and the header 2 names"),
        ("t,q,q\n0,1,2\n1,2,3\n", "log.csv: q is the name of 2 columns"),
        ("t,q\n0,1\n1,stop\n", "log.csv: q is text: row 1 has 'stop'"),
        ("t,q\n0,\n1,\n", "log.csv: q is empty"),
        ("t,q\n0,1\n1,2\n".encode("utf-16"), "log.csv is UTF-16: save it as UTF-8"),
        (b"\x00\xff\xfe\x01" * 40, "log.csv is no text"),
    ],
)
def test_a_table_that_is_not_understood_says_where(tmp_path, text, said):
    with pytest.raises(LogError) as error:
        read_log(csv(tmp_path, text)).array("q")
    assert said in str(error.value)


def test_what_is_packed_or_a_part_is_named(tmp_path):
    with pytest.raises(LogError, match=r"cannot read log\.xyz: there is no such file"):
        read_log(tmp_path / "log.xyz")
    csv(tmp_path, gzip.compress(b"t,q\n0,1\n1,2\n"), "log.csv.gz")
    with pytest.raises(LogError, match=r"log\.csv\.gz is compressed: unpack it first"):
        read_log(tmp_path / "log.csv.gz")
    csv(tmp_path, b"SQLite", "bag_0.db3")
    with pytest.raises(LogError, match="is a part of a ROS 2 bag: give its folder"):
        read_log(tmp_path / "bag_0.db3")


REFUSED = {
    "complex": "has complex numbers", "one": "has one row", "number": "has one row", "nothing": "is empty",
    "deep": r"has 3 dimensions \(3 x 4 x 5\)", "objects": "cannot be read: Object arrays", "words": "is text",
}  # fmt: skip


def test_arrays_of_every_kind(tmp_path):
    stamps = np.array(["2026-01-01T00:00:00", "NaT", "2026-01-01T00:00:02"], "M8[ms]")
    given = {
        "complex": np.ones(3, complex), "one": np.ones(1), "number": np.float64(3.0), "nothing": np.zeros(0),
        "deep": np.ones((3, 4, 5)), "objects": np.array([1, "a", None], object), "words": np.array(["hip", "knee"]),
        "big": np.arange(3.0).astype(">f4"), "fortran": np.asfortranarray(np.arange(6.0).reshape(3, 2)),
        "wide": np.arange(6.0).reshape(2, 3), "record": np.array([(1, 2.5)] * 3, [("a", "i4"), ("b", "f8")]),
        "half": np.ones(3, np.float16), "flags": np.array([True, False, True]), "when": stamps,
    }  # fmt: skip
    np.savez(tmp_path / "log.npz", **given)
    log = read_log(tmp_path / "log.npz")
    assert log.array("big").values[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert log.array("fortran[1]").values[:, 0].tolist() == [1.0, 3.0, 5.0]
    assert log.array("wide").values.tolist() == [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]]
    assert log.array("record.b").values[:, 0].tolist() == [2.5] * 3
    assert log.array("flags").values[:, 0].tolist() == [1.0, 0.0, 1.0]
    assert np.isnan(log.array("when").values[1, 0]) and log.array("when").unit == "ns"
    assert log.texts == {"words": ["hip", "knee"]}
    for name, why in REFUSED.items():
        with pytest.raises(LogError, match=f"log.npz: {name} {why}"):
            log.array(name)


def test_files_that_were_cut_off_are_said_to_be(tmp_path):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    h5py = pytest.importorskip("h5py")
    values = np.arange(2000.0)
    np.savez(tmp_path / "log.npz", q=values)
    pq.write_table(pa.table({"q": values}), tmp_path / "log.parquet")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["q"] = values
    for name in ("log.npz", "log.parquet", "log.h5"):
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(whole[: len(whole) // 2])
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # nothing stays open
            with pytest.raises(LogError, match=rf"cannot read {name}"):
                read_log(tmp_path / name)


def test_what_matlab_saves(tmp_path):
    h5py = pytest.importorskip("h5py")

    def put(file, name, values, kind):
        made = file.create_dataset(name, data=values)
        made.attrs["MATLAB_class"] = np.bytes_(kind)
        return made

    def cells(file, name, parts):
        made = file.create_dataset(name, (len(parts), 1), dtype=h5py.ref_dtype)
        made.attrs["MATLAB_class"] = np.bytes_("cell")
        made[:, 0] = [part.ref for part in parts]

    with h5py.File(tmp_path / "log.mat", "w", userblock_size=512) as file:
        put(file, "robot/q", np.arange(6.0).reshape(2, 3), "double")
        put(file, "label", np.array([[104], [105]], np.uint16), "char")
        put(file, "z", np.zeros((1, 3), [("real", "f8"), ("imag", "f8")]), "double")
        put(file, "none", np.zeros(2, np.uint64), "double").attrs["MATLAB_empty"] = np.uint8(1)
        codes = [put(file, f"#refs#/{k}", np.array([[ord(letter)] for letter in name], np.uint16), "char")
                 for k, name in enumerate(("hip", "knee"))]  # fmt: skip
        cells(file, "joints", codes)
        cells(file, "mixed", [codes[0], put(file, "#refs#/n", np.ones((1, 3)), "double")])
    log = read_log(tmp_path / "log.mat")
    assert list(log.arrays) == ["robot/q"]
    assert log.array("robot/q").values.tolist() == [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]]
    assert log.texts["joints"] == ["hip", "knee"]
    for name, why in {"label": "is text", "none": "is empty", "z": "has complex numbers",
                      "mixed": "is a cell array, of which only one of texts is read"}.items():  # fmt: skip
        with pytest.raises(LogError, match=f"{name} {why}"):
            log.array(name)
    (tmp_path / "old.mat").write_bytes(b"MATLAB 5.0 MAT-file, Platform: GLNXA64".ljust(200))
    with pytest.raises(LogError, match=r"a file of MATLAB before 7\.3; .*save\(\.\.\., '-v7\.3'\)"):
        read_log(tmp_path / "old.mat")


def test_a_file_that_names_another_does_not_have_it_read(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["secret"] = np.arange(5.0)
    layout = h5py.VirtualLayout((5,), "f8")
    layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "secret", (5,))
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["own"] = np.arange(5.0)
        file.create_virtual_dataset("virtual", layout)
        file["linked"] = h5py.ExternalLink("other.h5", "/secret")
    log = read_log(tmp_path / "log.h5")
    assert list(log.arrays) == ["own"]
    with pytest.raises(LogError, match="virtual is kept in another file"):
        log.array("virtual")
    with pytest.raises(LogError, match="has no column 'linked'"):
        log.array("linked")


def test_columns_of_parquet(tmp_path):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    fields = {
        "t": pa.array([10**18 + 1, 10**18 + 3, 10**18 + 5], pa.timestamp("ns")), "n": pa.array([1, None, 3], pa.int32()),
        "v": pa.array([{"x": 1.0, "y": 2.0}] * 3), "l": pa.array([[1, 2], [3, 4], None]), "d": pa.array([1, 2, 3], pa.decimal128(5, 2)),
        "b": pa.array([True, None, False]), "ragged": pa.array([[1], [1, 2], []]), "words": pa.array(["a", "b", "a"]).dictionary_encode(),
        "void": pa.nulls(3),
    }  # fmt: skip
    unit = pa.field("n", pa.int32(), metadata={"unit": "deg"})
    table = pa.table(fields)
    schema = table.schema.set(table.schema.get_field_index("n"), unit)
    pq.write_table(table.cast(schema), tmp_path / "log.parquet")
    log = read_log(tmp_path / "log.parquet")
    assert log.array("t").whole.tolist() == [10**18 + 1, 10**18 + 3, 10**18 + 5]
    assert log.array("n").values[:, 0] == pytest.approx([1.0, np.nan, 3.0], nan_ok=True)
    assert log.array("n").unit == "deg"
    assert log.array("v.y").values[:, 0].tolist() == [2.0] * 3
    assert log.array("l").values[:2].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert log.array("d").values[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert np.isnan(log.array("b").values[1, 0])
    for name, why in {"ragged": "has lists of different lengths, 0 to 2", "words": "is text", "void": "is empty"}.items():  # fmt: skip
        with pytest.raises(LogError, match=f"{name} {why}"):
            log.array(name)
