"""Texts of MATLAB's files: char arrays, cells of them, and strings, as MATLAB lays them out in HDF5."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.hal.log.log_file import read_log
from aloft.lab.studies.icub_estimators import JOINTS

from ...shared_data import FOLDER, needs_icub

h5py = pytest.importorskip("h5py")
NAMES = ["l_knee", "hüfte", "", "a"]


def characters(texts: list[str]) -> np.ndarray:
    """A char array as HDF5 has it: each text a column."""
    width = max(map(len, texts))
    return np.array([[ord(letter) for letter in text.ljust(width)] for text in texts], "<u2").T


def write(file: Any, name: str, values: np.ndarray, kind: str) -> Any:
    item = file.create_dataset(name, data=values)
    item.attrs["MATLAB_class"] = np.bytes_(kind)
    return item


def write_strings(file: Any, **strings: list[str]) -> None:
    """Write string arrays: each an object, the number of which is in the data set, of one part with lengths and characters."""
    count = len(strings)
    parts = [write(file, "#refs#/table", np.zeros((1, 1), np.uint8), "uint8").ref]
    parts.append(write(file, "#refs#/empty", np.zeros(2, np.uint64), "canonical empty").ref)
    blocks, objects = b"\0" * 8, b"\0" * 24
    for number, (name, texts) in enumerate(strings.items(), 1):
        letters = "".join(texts).encode("utf-16-le")
        letters += b"\0" * (-len(letters) % 8)
        head = [1, 2, 1, len(texts), *map(len, texts)]
        words = np.concatenate([np.array(head, "<u8"), np.frombuffer(letters, "<u8")])
        parts.append(write(file, f"#refs#/part{number}", words[:, None], "uint64").ref)
        blocks += struct.pack("<4I", 1, 1, 1, number - 1)
        objects += struct.pack("<6I", 1, 0, 0, number, 0, number)
        write(file, name, np.array([[0xDD000000, 2, 1, 1, number, 1]], np.uint32), "string")
    begin = 40 + 16
    table = struct.pack(
        "<10I",
        3,
        count,
        begin,
        begin,
        begin + len(blocks),
        *[begin + len(blocks) + len(objects)] * 5,
    )
    table = table.ljust(begin, b"\0") + blocks + objects
    del file["#refs#/table"]
    parts[0] = write(file, "#refs#/table", np.frombuffer(table, np.uint8)[None], "uint8").ref
    file.create_dataset(
        "#subsystem#/MCOS", data=np.array([parts], h5py.ref_dtype), dtype=h5py.ref_dtype
    )


def test_char_arrays_cells_and_strings_are_lists_of_texts(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.mat", "w") as file:
        file["q"] = np.zeros((4, 9))
        write(file, "rows", characters(NAMES), "char")
        parts = [
            write(file, f"#refs#/{k}", characters([name]), "char").ref
            for k, name in enumerate(NAMES)
            if name
        ]
        blank = write(file, "#refs#/blank", np.zeros(2, np.uint64), "char")
        blank.attrs["MATLAB_empty"] = np.uint8(1)
        parts.insert(2, blank.ref)
        cell = file.create_dataset(
            "cells", data=np.array([parts], h5py.ref_dtype), dtype=h5py.ref_dtype
        )
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
        write_strings(file, other=["x"], strings=NAMES)
    log = read_log(tmp_path / "log.mat")
    assert log.texts == {"rows": NAMES, "cells": NAMES, "strings": NAMES, "other": ["x"]}
    assert list(log.arrays) == ["q"], "characters are no columns"


def test_objects_that_are_no_texts_are_left_out(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.mat", "w") as file:
        file["q"] = np.zeros((4, 9))
        numbers = write(file, "#refs#/0", np.arange(4.0)[None], "double")
        cell = file.create_dataset(
            "cell", data=np.array([[numbers.ref]], h5py.ref_dtype), dtype=h5py.ref_dtype
        )
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
        write_strings(file, good=["a", "b"])
        for name, header in {
            "far": [0xDD000000, 2, 1, 1, 9, 1],
            "none": [7, 2, 1, 1, 1, 1],
            "short": [0xDD000000],
        }.items():
            write(file, name, np.array([header], np.uint32), "string")
    assert read_log(tmp_path / "log.mat").texts == {"good": ["a", "b"]}


@needs_icub
def test_an_icubs_log_has_the_names_of_its_joints() -> None:
    log = read_log(FOLDER / "icub" / "walking.mat")
    assert log.texts["estimatorJointsOrdering"] == JOINTS
    assert log.arrays["estimatorJointsPos"].values.shape[1] == len(JOINTS)
