"""Meshes: distance against brute force and against the analytic shape, inside by winding, and refusal of what is not closed."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from haptics.errors import InputError
from haptics.scene.geometry.mesh import TriangleMesh, load_mesh
from haptics.scene.geometry.shapes import Box

SIZE_M = (0.06, 0.1, 0.03)
BOX_VERTICES = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * SIZE_M
BOX_FACES = np.array(
    [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
)


def ball(rings: int = 12, radius_m: float = 0.04) -> TriangleMesh:
    """A closed ball of latitude rings."""
    vertices = [(0.0, radius_m, 0.0), (0.0, -radius_m, 0.0)]
    for ring in range(1, rings):
        polar = np.pi * ring / rings
        for step in range(2 * rings):
            turn = np.pi * step / rings
            vertices.append(
                (radius_m * np.sin(polar) * np.cos(turn), radius_m * np.cos(polar), radius_m * np.sin(polar) * np.sin(turn))
            )
    around = 2 * rings

    def at(ring: int, step: int) -> int:
        return 2 + (ring - 1) * around + step % around

    faces = []
    for step in range(around):
        faces.append((0, at(1, step + 1), at(1, step)))
        faces.append((1, at(rings - 1, step), at(rings - 1, step + 1)))
        for ring in range(1, rings - 1):
            faces.append((at(ring, step), at(ring, step + 1), at(ring + 1, step)))
            faces.append((at(ring, step + 1), at(ring + 1, step + 1), at(ring + 1, step)))
    return TriangleMesh(np.array(vertices), np.array(faces))


def cloud(count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.1, 0.1, (count, 3))


def brute_force_distance(point: np.ndarray, corners: np.ndarray, steps: int = 60) -> float:
    """Nearest of a fine barycentric grid over every triangle."""
    grid = np.array([(i, j, steps - i - j) for i in range(steps + 1) for j in range(steps + 1 - i)]) / steps
    samples = np.einsum("gk,fki->fgi", grid, corners)
    return float(np.sqrt(((samples - point) ** 2).sum(axis=2).min()))


def test_a_box_mesh_has_the_distance_and_the_normals_of_the_box():
    mesh, box, points = TriangleMesh(BOX_VERTICES, BOX_FACES), Box(SIZE_M), cloud(500)
    assert mesh.distance(points) == pytest.approx(box.distance(points), abs=1e-15)
    unique = np.sort(np.abs(np.abs(points) - np.array(SIZE_M) / 2), axis=1)[:, 0] > 1e-3  # away from ties between faces
    assert mesh.gradient(points)[unique] == pytest.approx(box.gradient(points)[unique], abs=1e-9)
    assert mesh.volume_m3 == pytest.approx(float(np.prod(SIZE_M)), rel=1e-12)


@pytest.mark.slow
def test_distance_is_that_of_brute_force_over_sampled_triangles():
    mesh = ball(6)
    corners = mesh.vertices_m[mesh.faces]
    for point, found in zip(points := cloud(40, seed=2), mesh.distance(points), strict=True):
        brute = brute_force_distance(point, corners)
        assert abs(found) <= brute + 1e-12
        assert abs(found) == pytest.approx(brute, abs=5e-4)  # the grid's spacing is 0.35 mm


def test_random_triangles_give_the_nearest_point_in_every_region():
    rng = np.random.default_rng(5)
    from haptics.scene.geometry.mesh import _nearest_on_triangles

    for _ in range(100):
        corners, point = rng.normal(size=(1, 3, 3)), 2.0 * rng.normal(size=3)
        nearest = _nearest_on_triangles(point, corners)[0]
        distance = float(np.linalg.norm(nearest - point))
        assert distance <= brute_force_distance(point, corners) + 1e-12
        weights = np.linalg.lstsq(np.vstack([corners[0].T, np.ones(3)]), np.append(nearest, 1.0), rcond=None)[0]
        assert weights.min() > -1e-9  # it lies on the triangle
        assert corners[0].T @ weights == pytest.approx(nearest, abs=1e-9)


def test_a_finer_ball_comes_nearer_to_the_sphere_with_the_square_of_its_edge():
    points = cloud(60, seed=3)
    errors = [np.abs(ball(rings).distance(points) - (np.linalg.norm(points, axis=1) - 0.04)).max() for rings in (8, 16, 32)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.25)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.25)


def test_distance_never_changes_faster_than_one_metre_a_metre():
    mesh, a, b = ball(8), cloud(200, seed=6), cloud(200, seed=7)
    assert (np.abs(mesh.distance(a) - mesh.distance(b)) <= np.linalg.norm(a - b, axis=1) + 1e-12).all()


def test_inside_is_right_where_rays_graze_edges_and_corners():
    mesh = TriangleMesh(BOX_VERTICES, BOX_FACES)
    along_diagonals = BOX_VERTICES * np.linspace(0.05, 0.99, 20)[:, None, None]
    assert mesh.inside(along_diagonals.reshape(-1, 3)).all()
    assert not mesh.inside(BOX_VERTICES * 1.01).any()


def test_an_inside_out_mesh_is_turned():
    turned = TriangleMesh(BOX_VERTICES, BOX_FACES[:, ::-1])
    assert turned.distance(np.zeros((1, 3)))[0] == pytest.approx(-0.015, abs=1e-15)


def test_a_point_on_the_surface_has_distance_zero_and_the_face_normal():
    mesh = TriangleMesh(BOX_VERTICES, BOX_FACES)
    on_top = np.array([[0.01, 0.05, 0.002]])
    assert mesh.distance(on_top)[0] == pytest.approx(0.0, abs=1e-15)
    assert mesh.gradient(on_top)[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(
    ("vertices", "faces", "match"),
    [
        (BOX_VERTICES, BOX_FACES[:-1], "open"),
        (BOX_VERTICES, np.vstack([BOX_FACES, [[0, 1, 6]]]), "not manifold|open"),
        (np.where(np.arange(24).reshape(8, 3) == 4, np.nan, BOX_VERTICES), BOX_FACES, "vertex 1 is"),
        (BOX_VERTICES, np.vstack([BOX_FACES, [[0, 1, 1]]]), "triangle 12 .* no area"),
        (BOX_VERTICES, np.vstack([BOX_FACES[:-1], [[1, 7, 30]]]), "triangle 11 names vertices"),
        (BOX_VERTICES, np.vstack([BOX_FACES[:-1], BOX_FACES[-1:, ::-1]]), "wound against each other"),
        (np.zeros((0, 3)), np.zeros((0, 3), int), "no triangles"),
    ],
    ids=["open", "fin", "nan", "degenerate", "index", "winding", "empty"],
)
def test_what_is_not_a_closed_mesh_is_refused_with_its_place(vertices, faces, match):
    with pytest.raises(InputError, match=match):
        TriangleMesh(vertices, faces, name="thing.obj")


def obj_text() -> str:
    lines = [f"v {x} {y} {z}" for x, y, z in BOX_VERTICES * 1000.0]
    return "\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in BOX_FACES]) + "\n"


def stl_bytes(binary: bool) -> bytes:
    triangles = BOX_VERTICES[BOX_FACES] * 1000.0
    if binary:
        body = b"".join(struct.pack("<12fH", *[0.0] * 3, *triangle.reshape(-1), 0) for triangle in triangles)
        return b"\0" * 80 + struct.pack("<I", len(triangles)) + body
    text = "solid box\n"
    for triangle in triangles:
        corners = "".join(f"vertex {x} {y} {z}\n" for x, y, z in triangle)
        text += f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n"
    return (text + "endsolid box\n").encode()


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.obj", obj_text().encode()), ("a.stl", stl_bytes(True)), ("b.STL", stl_bytes(False))],
    ids=["obj", "binary", "text"],
)
def test_files_in_millimetres_become_metres(tmp_path: Path, name: str, content: bytes):
    pytest.importorskip("trimesh")
    (tmp_path / name).write_bytes(content)
    mesh = load_mesh(tmp_path / name, scale=0.001)
    assert mesh.volume_m3 == pytest.approx(float(np.prod(SIZE_M)), rel=1e-6)  # binary STL holds single precision
    assert len(mesh.vertices_m) == 8


@pytest.mark.parametrize(
    ("name", "content", "match"),
    [
        ("a.obj", b"no mesh at all\n", "no triangles|cannot be read"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "line 4: 'f 1 2 9'; allowed: vertices 1 to 3"),
        ("a.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "line 1: 'v 0 0 nan'"),
        ("a.stl", b"\0" * 80 + b"\xff\xff\xff\x7f" + b"\0" * 50, "a.stl"),
        ("a.stl", b"", "a.stl"),
        ("a.ply", b"", "a.ply is empty; expected a mesh as .obj, .stl, .ply"),
        ("a.glb", b"glTF", "type .glb; export it as one of: .obj, .stl, .ply"),
    ],
    ids=["words", "index", "nan", "cut short", "empty", "empty too", "format"],
)
def test_broken_files_are_refused_by_name(tmp_path: Path, name: str, content: bytes, match: str):
    pytest.importorskip("trimesh")
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=match):
        load_mesh(tmp_path / name)


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(InputError, match="does not exist"):
        load_mesh(tmp_path / "gone.obj")
