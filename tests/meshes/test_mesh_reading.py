"""Files as other programs write them: the same triangles, or the line at fault and what is allowed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.meshes import read_triangles

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def read(folder: Path, text: str, name: str = "a.obj"):
    (folder / name).write_text(text, encoding="utf-8")
    return read_triangles(folder / name, extra="mesh")


@pytest.mark.parametrize(
    "text",
    [
        SQUARE + "f 1 2 3 4\n",
        SQUARE + "f -4 -3 -2 -1\n",
        SQUARE + "f 1/1/1 2/2/1 3//1 4/7\n",
        "mtllib a.mtl\no a\ng b\nusemtl red\ns off\n" + SQUARE.replace("\n", " 0.1 0.2 0.3\n") + "usemtl blue\nf 1 2 3 4\n",
        SQUARE + "f 1 2 \\\n3 4\n",
        "\ufeff" + SQUARE + "f 1 2 3 4\n",
        SQUARE.replace("\n", "\r\n") + "f 1 2 3 4 # a square\r\n",
    ],
    ids=["quad", "counting back", "textures", "materials and colours", "continued line", "byte order mark", "dos"],
)
def test_an_obj_gives_the_same_two_triangles_however_it_is_written(tmp_path, text):
    vertices, triangles = read(tmp_path, text)
    assert vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert triangles.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_a_polygon_of_n_corners_has_its_area(tmp_path):
    turn = 2 * np.pi * np.arange(7) / 7
    text = "".join(f"v {x} {y} 0\n" for x, y in zip(np.cos(turn), np.sin(turn), strict=True)) + "f 1 2 3 4 5 6 7\n"
    vertices, triangles = read(tmp_path, text)
    area = 0.5 * np.linalg.norm(
        np.cross(vertices[triangles[:, 1]] - vertices[triangles[:, 0]], vertices[triangles[:, 2]] - vertices[triangles[:, 0]]),
        axis=1,
    )
    assert area.sum() == pytest.approx(3.5 * np.sin(2 * np.pi / 7))


@pytest.mark.parametrize("name", ["binary.stl", "text.stl", "binary.ply", "text.ply"])
def test_stl_and_ply_give_each_corner_once(tmp_path, name):
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    kind = {"text.stl": {"file_type": "stl_ascii"}, "text.ply": {"encoding": "ascii"}}.get(name, {})
    box.export(tmp_path / name, **kind)
    vertices, triangles = read_triangles(tmp_path / name, extra="mesh")
    assert (len(vertices), len(triangles)) == (8, 12)
    assert np.ptp(vertices, axis=0) == pytest.approx([0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.obj", SQUARE.replace("1", "0,5") + "f 1 2 3\n", "line 2: 'v 0,5 0 0'; allowed: .* decimal commas"),
        ("a.obj", SQUARE + "f 1 2 9\n", "line 5: 'f 1 2 9'; allowed: vertices 1 to 4"),
        ("a.obj", SQUARE + "f 1 2 -9\n", "line 5: .*allowed: vertices 1 to 4"),
        ("a.obj", "v 0 inf 0\n" + SQUARE + "f 1 2 3\n", "line 1: 'v 0 inf 0'"),
        ("a.obj", SQUARE, "has no triangles, only 4 points"),
        ("a.obj", "ply\nformat ascii 1.0\n", "no triangles; it begins like a .ply file, and is named .obj"),
        ("a.obj", "", "a.obj is empty"),
        ("a.gltf", "{}", r"of type \.gltf; allowed: \.obj, \.stl, \.ply; export it as one of them"),
        ("mesh", "", r"of type \(none\)"),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n",
            "no triangles, only 1 point",
        ),
    ],
)
def test_what_cannot_be_read_is_said_with_its_place(tmp_path, name, text, message):
    if name.endswith(".ply"):
        pytest.importorskip("trimesh")
    with pytest.raises(InputError, match=message):
        read(tmp_path, text, name)


@pytest.mark.parametrize("name", ["binary.stl", "text.stl", "binary.ply", "text.ply", "quads.ply"])
def test_a_file_cut_short_anywhere_is_refused(tmp_path, name):
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    if name == "quads.ply":
        rows = "4 0 1 2 3\n4 4 5 6 7\n"
        points = "".join(f"{x} {y} {z}\n" for x, y, z in box.vertices)
        head = "".join(f"property float {axis}\n" for axis in "xyz") + "element face 2\nproperty list uchar int vertex_indices\n"
        (tmp_path / name).write_text(f"ply\nformat ascii 1.0\nelement vertex 8\n{head}end_header\n{points}{rows}")
        assert len(read_triangles(tmp_path / name, extra="mesh")[1]) == 4
    else:
        box.export(tmp_path / name, **{"text.stl": {"file_type": "stl_ascii"}, "text.ply": {"encoding": "ascii"}}.get(name, {}))
    whole = (tmp_path / name).read_bytes().rstrip(b"\n")
    for share in (0.1, 0.5, 0.9, 0.97):
        (tmp_path / name).write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(InputError, match=f"{name} (is cut short|has no triangles|cannot be read as)"):
            read_triangles(tmp_path / name, extra="mesh")


def test_decimal_commas_in_an_stl_are_named(tmp_path):
    pytest.importorskip("trimesh")
    corners = "".join(f"vertex {x} {y} 0,0\n" for x, y in (("0,0", "0,0"), ("1,0", "0,0"), ("0,0", "1,0")))
    text = f"solid a\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid a\n"
    with pytest.raises(InputError, match=r"cannot be read as STL: .*; it has decimal commas, export it with points"):
        read(tmp_path, text, "a.stl")


def test_a_scan_is_refused_with_what_to_do(tmp_path):
    with pytest.raises(InputError, match=r"has 200001 triangles; allowed: at most 200000; reduce \(decimate\) it"):
        read(tmp_path, SQUARE + "f 1 2 3\n" * 200_001)
