"""Packages are found near the file, and meshes are read from STL and OBJ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aloft.robots.importing.meshes import mesh_triangles
from aloft.robots.importing.package_files import find_file, package_of


def test_a_package_is_a_folder_above_or_beside(tmp_path: Path) -> None:
    mesh = tmp_path / "arm_description" / "meshes" / "upper.stl"
    mesh.parent.mkdir(parents=True)
    mesh.touch()
    name = "package://arm_description/meshes/upper.stl"
    urdf_folder = tmp_path / "arm_description" / "urdf"
    urdf_folder.mkdir()
    other = tmp_path / "graphs" / "deep"
    other.mkdir(parents=True)
    assert find_file(name, urdf_folder) == mesh  # the folder above is the package
    assert find_file(name, other) == mesh  # a folder above holds it
    assert find_file("../meshes/upper.stl", urdf_folder) == urdf_folder / "../meshes/upper.stl"
    assert find_file("package://arm_description/meshes/lower.stl", urdf_folder) is None
    assert (package_of(name), package_of("meshes/upper.stl")) == ("arm_description", "")


def test_no_environment_variable_is_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = tmp_path / "hidden" / "far_description" / "a.stl"
    mesh.parent.mkdir(parents=True)
    mesh.touch()
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "PYTHONPATH", "CMAKE_PREFIX_PATH"):
        monkeypatch.setenv(variable, str(tmp_path / "hidden"))
    (tmp_path / "here").mkdir()
    assert find_file("package://far_description/a.stl", tmp_path / "here") is None


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 0, 1]], dtype=float)


def test_binary_stl(tmp_path: Path) -> None:
    layout = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
    triangles = np.zeros(2, layout)
    triangles["corners"] = CORNERS.reshape(2, 3, 3)
    (tmp_path / "a.stl").write_bytes(
        b"solid".ljust(80) + np.uint32(2).tobytes() + triangles.tobytes()
    )
    assert mesh_triangles(tmp_path / "a.stl").tolist() == CORNERS.reshape(2, 3, 3).tolist()


def test_text_stl_and_obj(tmp_path: Path) -> None:
    lines = [f"      vertex {x} {y} {z}" for x, y, z in CORNERS]
    (tmp_path / "a.STL").write_text("solid a\n facet\n" + "\n".join(lines) + "\nendsolid a\n")
    expected = CORNERS.reshape(2, 3, 3).tolist()
    assert mesh_triangles(tmp_path / "a.STL").tolist() == expected
    obj = "# an object\n" + "\n".join(f"v {x} {y} {z}" for x, y, z in CORNERS) + "\nvn 0 0 1\n"
    (tmp_path / "a.obj").write_text(f"{obj}f 1 2 3\nf 4// 5// 6//\n")
    assert mesh_triangles(tmp_path / "a.obj").tolist() == expected


def test_what_is_no_mesh(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(b"nothing")
    with pytest.raises(ValueError, match="a mesh of 0 triangles"):
        mesh_triangles(tmp_path / "a.stl")
    (tmp_path / "a.ply").touch()
    with pytest.raises(ValueError, match=r"no mesh of the formats \.stl, \.obj, \.dae"):
        mesh_triangles(tmp_path / "a.ply")
