"""Files as other programs write them: the same triangles, or the line at fault and what is expected."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.meshes import read_triangles

PLY = (
    "ply\nformat {} 1.0\nelement vertex 10\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {}\nproperty list uchar int {}\n"
)
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def read(folder: Path, text: str, name: str = "a.obj"):
    (folder / name).write_text(text, encoding="utf-8")
    return read_triangles(folder / name)


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
        (SQUARE + "f 1 2 3 4\n").encode("utf-16"),
    ],
    ids=["quad", "counting back", "textures", "materials and colours", "continued line", "byte order mark", "dos", "utf-16"],
)
def test_an_obj_gives_the_same_two_triangles_however_it_is_written(tmp_path, text):
    (tmp_path / "a.obj").write_bytes(text if isinstance(text, bytes) else text.encode())
    vertices, triangles = read_triangles(tmp_path / "a.obj")
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
    vertices, triangles = read_triangles(tmp_path / name)
    assert (len(vertices), len(triangles)) == (8, 12)
    assert np.ptp(vertices, axis=0) == pytest.approx([0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.obj", SQUARE.replace("1", "0,5") + "f 1 2 3\n", "line 2: 'v 0,5 0 0'; expected .* decimal commas"),
        ("a.obj", SQUARE + "f 1 2 9\n", "line 5: 'f 1 2 9'; allowed: vertices 1 to 4"),
        ("a.obj", SQUARE + "f 1 2 -9\n", "line 5: .*allowed: vertices 1 to 4"),
        ("a.obj", "v 0 inf 0\n" + SQUARE + "f 1 2 3\n", "line 1: 'v 0 inf 0'"),
        ("a.obj", "v 0_5 0 0\n" + SQUARE + "f 1 2 3\n", "line 1: 'v 0_5 0 0'"),
        ("a.obj", SQUARE + "f 1 2 99999999999999999999\n", "line 5: 'f 1 2 99999999999999999999'"),
        ("a.obj", SQUARE, "has no triangles, only 4 points"),
        ("a.obj", "<!DOCTYPE html>\n", "no triangles; it begins '<!DOCTYPE html>'"),
        ("a.stl", "version https://git-lfs.github.com/spec/v1\n", "no triangles; it begins 'version https://git-lfs"),
        ("a.ply", SQUARE, "no triangles; it begins 'v 0 0 0'"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex x\n", "line 3: 'element vertex x' does not belong in a header"),
        (
            "a.ply",
            PLY.format("ascii", 5, "indices") + "end_header\n" + "0 " * 35,
            "no vertex_indices or vertex_index, only indices",
        ),
        ("a.ply", PLY.format("ascii", 10**12, "vertex_indices") + "end_header\n", "is cut short"),
        ("a.ply", PLY.format("ascii", 0, "vertex_indices") + "end_header\n" + "0 " * 30, "no triangles, only 10 points"),
        ("a.obj", "ply\nformat ascii 1.0\n", "no triangles; it begins like a .ply file, and is named .obj"),
        ("a.obj", "", "a.obj is empty"),
        ("a.gltf", "{}", r"of type \.gltf; export it as one of: \.obj, \.stl, \.ply"),
        ("mesh", "", r"of type \(none\)"),
        (
            "a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n",
            "no triangles, only 1 point",
        ),
    ],
)
def test_what_cannot_be_read_is_said_with_its_place(tmp_path, name, text, message):
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
        assert len(read_triangles(tmp_path / name)[1]) == 4
    else:
        box.export(tmp_path / name, **{"text.stl": {"file_type": "stl_ascii"}, "text.ply": {"encoding": "ascii"}}.get(name, {}))
    whole = (tmp_path / name).read_bytes().rstrip(b"\n")
    for share in (0.1, 0.5, 0.9, 0.97):
        (tmp_path / name).write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(InputError, match=f"{name} (is cut short|has no triangles|cannot be read as)"):
            read_triangles(tmp_path / name)


@pytest.mark.parametrize("order", ["<", ">", ""])
def test_a_ply_of_polygons_of_any_number_of_corners_is_read(tmp_path, order):
    """A prism on five corners, as programs write whose meshes have polygons, with more about vertices and edges than is asked."""
    turn = 2 * np.pi * np.arange(5) / 5
    points = np.array([[np.cos(a), np.sin(a), z] for z in (0, 1) for a in turn], dtype=np.float32)
    faces = [[4, 3, 2, 1, 0], [5, 6, 7, 8, 9]] + [[k, (k + 1) % 5, (k + 1) % 5 + 5, k + 5] for k in range(5)]
    name = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    head = PLY.format(name, len(faces), "vertex_index").replace("element face", "property uchar red\nelement face")
    head += "property float quality\nelement edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    if order:
        body = b"".join(struct.pack(order + "3fB", *p, 9) for p in points)
        body += b"".join(struct.pack(f"{order}B{len(f)}if", len(f), *f, 0.5) for f in faces) + struct.pack(order + "2i", 0, 1)
    else:
        rows = [f"{x} {y} {z} 9" for x, y, z in points.tolist()] + [f"{len(f)} {' '.join(map(str, f))} 0.5" for f in faces]
        body = "\n".join([*rows, "0 1\n"]).encode()
    (tmp_path / "a.ply").write_bytes(head.encode() + body)
    vertices, triangles = read_triangles(tmp_path / "a.ply")
    corners = vertices[triangles]
    assert len(triangles) == 16
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert volume == pytest.approx(2.5 * np.sin(2 * np.pi / 5))
    for length in range(len(head), len(head) + len(body) - 4):
        (tmp_path / "a.ply").write_bytes((head.encode() + body)[:length])
        with pytest.raises(InputError, match=r"a\.ply"):
            read_triangles(tmp_path / "a.ply")


FACET = "facet normal 0 0 1\nouter loop\nvertex {0} 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"


def test_an_stl_of_several_solids_and_one_with_bytes_after_its_end(tmp_path):
    text = "".join(f"solid {k}\n{FACET.format(-k)}endsolid {k}\n" for k in (0, 1, 2))
    for written in (text, text.upper(), text.replace("\n", "\r\n")):
        assert len(read(tmp_path, written, "a.stl")[1]) == 3
    with pytest.raises(InputError, match="it is cut short: 3 facets begin, 2 end, 8 corners"):
        read(tmp_path, text[: text.rindex("vertex")], "a.stl")
    facets = b"".join(struct.pack("<12fH", 0, 0, 1, -k, 0, 0, 1, 0, 0, 0, 1, 0, 0x8FFF) for k in range(3))
    whole = b"solid of a program".ljust(80) + struct.pack("<I", 3) + facets
    for tail in (b"", b"\0\0\0"):
        (tmp_path / "a.stl").write_bytes(whole + tail)
        assert len(read_triangles(tmp_path / "a.stl")[1]) == 3
    for broken in (whole[:-1], whole + facets, whole[:80] + b"\xff" * 4 + facets):
        (tmp_path / "a.stl").write_bytes(broken)
        with pytest.raises(InputError, match=r"a\.stl"):
            read_triangles(tmp_path / "a.stl")


@pytest.mark.parametrize("name", ["a.obj", "a.ply", "text.stl", "a.stl"])
def test_a_large_file_is_counted_and_not_kept(tmp_path, monkeypatch, name):
    monkeypatch.setattr("haptics.meshes.files.LARGEST_TRIANGLES", 2)
    content = {
        "a.obj": SQUARE + "f 1 2 3 4\nf 1 2 rubbish\n",
        "a.ply": PLY.format("ascii", 3, "vertex_indices") + "end_header\n" + "0 " * 33,
        "text.stl": "solid a\n" + 3 * FACET.format(0) + "endsolid a\n",
        "a.stl": "\0" * 80 + "\3\0\0\0" + "\0" * 150,
    }
    with pytest.raises(InputError, match="has 3 triangles; at most 2 are read; reduce"):
        read(tmp_path, content[name], name)


def test_decimal_commas_in_an_stl_are_named(tmp_path):
    corners = "".join(f"vertex {x} {y} 0,0\n" for x, y in (("0,0", "0,0"), ("1,0", "0,0"), ("0,0", "1,0")))
    text = f"solid a\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid a\n"
    with pytest.raises(InputError, match=r"cannot be read as STL: .*; it has decimal commas, export it with points"):
        read(tmp_path, text, "a.stl")


def test_a_scan_is_refused_with_what_to_do(tmp_path):
    with pytest.raises(InputError, match=r"has 200001 triangles; at most 200000 are read; reduce \(decimate\) it"):
        read(tmp_path, SQUARE + "f 1 2 3\n" * 200_001)
