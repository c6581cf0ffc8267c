"""Mesh files: written for others to read, read back the same, and refused with the place of the fault."""

import numpy as np
import pytest
import trimesh
from analytic_garments import cap, tube

from haptics.errors import InputError
from haptics.garments.mesh_files import read_mesh, write_obj, write_ply

MESH = tube(around=12, along=8)
DESIGN = MESH.centres_m[:, 2] > 0.2
ENERGY_J = MESH.areas_m2 * np.linspace(0.0, 50.0, len(DESIGN))


def test_obj_comes_back_the_same_with_its_triangles_grouped(tmp_path):
    obj, mtl = write_obj(MESH, DESIGN, tmp_path / "sleeve.obj")
    back = read_mesh(obj)
    assert np.array_equal(back.vertices_m, MESH.vertices_m)
    assert np.array_equal(back.triangles, np.vstack([MESH.triangles[~DESIGN], MESH.triangles[DESIGN]]))
    assert mtl.name in obj.read_text()


def test_another_reader_finds_the_two_materials_and_their_areas(tmp_path):
    obj, _ = write_obj(MESH, DESIGN, tmp_path / "sleeve.obj")
    scene = trimesh.load_scene(obj, process=False, group_material=True)
    areas = {geometry.visual.material.name: geometry.area for geometry in scene.geometry.values()}
    assert areas["reinforcement"] == pytest.approx(MESH.areas_m2[DESIGN].sum())
    assert areas["cloth"] == pytest.approx(MESH.areas_m2[~DESIGN].sum())


def test_ply_carries_energy_design_and_colours(tmp_path):
    (path,) = write_ply(MESH, DESIGN, ENERGY_J, tmp_path / "sleeve.ply")
    back = trimesh.load_mesh(path, process=False)
    assert np.array_equal(back.vertices, MESH.vertices_m)
    assert np.array_equal(back.faces, MESH.triangles)
    face = back.metadata["_ply_raw"]["face"]["data"]
    np.testing.assert_allclose(np.ravel(face["energy_j_m2"]), ENERGY_J / MESH.areas_m2, rtol=1e-6)
    assert np.array_equal(np.ravel(face["reinforced"]), DESIGN)
    # Energy grows from bottom to top, and so does the light in the colours.
    light = back.visual.vertex_colors[:, :3].sum(axis=1).astype(int)
    heights = np.unique(MESH.vertices_m[:, 2])
    rows = [light[MESH.vertices_m[:, 2] == height].mean() for height in heights]
    assert np.all(np.diff(rows) >= 0)
    assert rows[-1] > rows[0] + 200
    assert np.array_equal(read_mesh(path).triangles, MESH.triangles)


def test_libigl_reads_both(tmp_path):
    import igl

    obj, _ = write_obj(MESH, DESIGN, tmp_path / "sleeve.obj")
    (ply,) = write_ply(MESH, DESIGN, ENERGY_J, tmp_path / "sleeve.ply")
    for path in (obj, ply):
        vertices, triangles = igl.read_triangle_mesh(str(path))
        np.testing.assert_allclose(vertices, MESH.vertices_m, atol=1e-12)
        assert len(triangles) == len(MESH.triangles)


@pytest.mark.parametrize("kind", ["stl", "ply", "obj"])
def test_files_of_another_program_are_read(tmp_path, kind):
    path = tmp_path / f"cap.{kind}"
    trimesh.Trimesh(cap().vertices_m, cap().triangles, process=False).export(path)
    mesh = read_mesh(path)
    assert len(mesh.vertices_m) == len(cap().vertices_m)
    assert len(mesh.boundary_edges) == len(cap().boundary_edges)
    assert mesh.areas_m2.sum() == pytest.approx(cap().areas_m2.sum(), rel=1e-5)


def test_polygons_textures_and_counting_back_in_an_obj(tmp_path):
    path = tmp_path / "square.obj"
    path.write_text("o square\nvt 0 0\n" + OBJ + "s off\nf 1/1 2/1 4/1 3/1 # a square\nv 0.2 0 0\nf -4//1 -1//1 -2//1\n")
    mesh = read_mesh(path)
    assert mesh.triangles.tolist() == [[0, 1, 3], [0, 3, 2], [1, 4, 3]]


def test_no_energy_at_all_is_dark_everywhere(tmp_path):
    (path,) = write_ply(MESH, DESIGN, np.zeros(len(DESIGN)), tmp_path / "still.ply")
    colours = trimesh.load_mesh(path, process=False).visual.vertex_colors[:, :3]
    assert np.array_equal(colours, np.tile([68, 1, 84], (len(colours), 1)))


OBJ = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0.1 0.1 0\n"


@pytest.mark.parametrize(
    ("faces", "note"),
    [
        ("f 1 2 3\nf 2 3 4\n", "a.obj: 1 triangle turned to face as the rest of 2 do"),
        ("f 1 2 3\nf 2 4 3\nf 2 1 2\n", "a.obj: 1 triangle without area left out"),
        ("f 1 2 3\nf 2 4 3\nf 3 1 2\n", "a.obj: 1 triangle given twice left out"),
    ],
)
def test_a_broken_surface_is_mended_with_a_note(tmp_path, faces, note):
    (tmp_path / "a.obj").write_text(OBJ + faces)
    notes = []
    mesh = read_mesh(tmp_path / "a.obj", note=notes.append)
    assert notes == [note]
    assert mesh.areas_m2.sum() == pytest.approx(0.01)
    assert mesh.cross_m2[:, 2].sum() == pytest.approx(0.02)  # both face up


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.obj", OBJ + "v 0 zero 0\nf 1 2 3\n", r"a\.obj, line 5: 'v 0 zero 0'; expected v and three finite coordinates"),
        ("a.obj", "v 0 0 nan\n" + OBJ + "f 1 2 3\n", r"a\.obj, line 1: 'v 0 0 nan'"),
        ("a.obj", OBJ + "f 1 2 9\n", r"a\.obj, line 5: 'f 1 2 9'; allowed: vertices 1 to 4"),
        ("a.obj", OBJ + "f 1 2\n", r"a\.obj, line 5"),
        ("a.obj", OBJ + "f 1 2 0\n", r"a\.obj, line 5"),
        ("a.obj", OBJ.replace("0.1", "100") + "f 1 2 3\nf 2 4 3\n", r"a\.obj: it is 100 m across; .* centimetres\?.* --units cm"),
        ("a.ply", "ply\nformat ascii 1.0\nrubbish\n", r"a\.ply cannot be read as PLY"),
        ("a.stl", "", r"a\.stl"),
        ("a.glb", "glTF", r"a\.glb is of type \.glb; export it as one of: \.obj, \.stl, \.ply"),
    ],
)
def test_a_broken_file_is_refused_with_the_place(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=message):
        read_mesh(tmp_path / name)


def test_a_missing_file_and_an_open_body_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"none\.obj is not a file"):
        read_mesh(tmp_path / "none.obj")
    obj, _ = write_obj(MESH, DESIGN, tmp_path / "sleeve.obj")
    with pytest.raises(InputError, match="it is open at edge"):
        read_mesh(obj, closed=True)


def test_nothing_is_overwritten_and_lengths_are_checked(tmp_path):
    (tmp_path / "sleeve.mtl").write_text("mine")
    with pytest.raises(InputError, match=r"sleeve\.mtl exists"):
        write_obj(MESH, DESIGN, tmp_path / "sleeve.obj")
    assert [path.name for path in tmp_path.iterdir()] == ["sleeve.mtl"]
    assert len(write_obj(MESH, DESIGN, tmp_path / "sleeve.obj", force=True)) == 2
    with pytest.raises(InputError, match="the design is bool of shape"):
        write_obj(MESH, DESIGN[:3], tmp_path / "other.obj")
    with pytest.raises(InputError, match="expected finite"):
        write_ply(MESH, DESIGN, np.full(len(DESIGN), np.nan), tmp_path / "other.ply")
    with pytest.raises(InputError, match=r"suffix of other\.stl"):
        write_ply(MESH, DESIGN, ENERGY_J, tmp_path / "other.stl")
