"""A garment drawn elsewhere: around an exported body, in any unit and axes, with faults that are mended and said."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from quick_garments import quick_garments

from haptics.garments.bodies import open_body
from haptics.garments.design import job
from haptics.garments.garment import cut_garment, open_garment
from haptics.garments.mesh import SurfaceMesh

trimesh = pytest.importorskip("trimesh", reason="extra `garment`")
pytest.importorskip("igl", reason="extra `garment`")
BODY = open_body("capsule")


@pytest.fixture(scope="module", autouse=True)
def _quick():
    with quick_garments():
        yield


def _sleeve() -> SurfaceMesh:
    cut = cut_garment(BODY, "sleeve", "coarse")
    mesh = SurfaceMesh(cut.on(BODY.straight_m), cut.triangles)
    return mesh.at(mesh.vertices_m + 0.003 * mesh.vertex_normals)


SLEEVE = _sleeve()
V, F = SLEEVE.vertices_m, SLEEVE.triangles
X, Y, Z = V.T


def write(path: Path, vertices, faces) -> Path:
    lines = ["v {!r} {!r} {!r}".format(*map(float, v)) for v in vertices] + [
        "f {} {} {}".format(*(f + 1)) for f in np.asarray(faces)
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def words(path: Path, *more: object) -> tuple[object, ...]:
    return ("garment", "design", "--garment", path, "--motion", "elbow_flexion", "--coverage", "0.98", *more)


def opened(path: Path, **frame):
    return open_garment(BODY, str(path), "own", **frame)


@pytest.fixture
def right(tmp_path) -> np.ndarray:
    """Where the sleeve lies on the body as it was drawn."""
    return opened(write(tmp_path / "right.obj", V, F)).on(BODY.straight_m)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vertices", "frame", "seen"),
    [
        (V * 1000, {"units": "mm"}, "it is 469.5 m across; drawn in millimetres it lies on the body"),
        (V * 100, {"units": "cm"}, "it is 46.95 m across; drawn in centimetres it lies on the body"),
        (V * 10, {"units": "dm"}, "it is 4.695 m across; drawn in decimetres it lies on the body"),
        (V / 0.0254, {"units": "in"}, "it is 18.48 m across; drawn in inches it lies on the body"),
        (V / 0.3048, {"units": "ft"}, "it is 1.54 m across; drawn in feet it lies on the body"),
        (np.stack([X, Z, -Y], axis=1), {"up": "y"}, "it looks y up; this body is z up"),
        (np.stack([Y, Z, X], axis=1), {"up": "y"}, "it looks y up; this body is z up"),
        (np.stack([Z, Y, -X], axis=1), {"up": "x"}, "it looks x up; this body is z up"),
        (np.stack([Z, X, Y], axis=1), {"up": "x"}, "it looks x up; this body is z up"),
        (np.stack([-Y, X, Z], axis=1), {"up": "z"}, "it is turned about the vertical; this body faces -y"),
        (1000 * np.stack([X, Z, -Y], axis=1), {"units": "mm", "up": "y"}, "millimetres it lies on the body; it looks y up"),
    ],
    ids=["mm", "cm", "dm", "in", "ft", "y up", "y up, other way round", "x up", "x up, other way round", "turned", "mm, y up"],
)
def test_units_and_axes_are_named_and_the_cure_is_right(vertices, frame, seen, right, tmp_path, refused):
    path = write(tmp_path / "mine.obj", vertices, F)
    error = refused(*words(path, "--out", tmp_path / "d"))
    options = [word for key, value in frame.items() for word in (f"--{key}", value)]
    assert seen in error
    assert error.endswith(f"; pass {' '.join(options)}, as it was drawn\n")
    assert not (tmp_path / "d").exists()
    assert opened(path, **frame).on(BODY.straight_m) == pytest.approx(right, abs=1e-6)


def test_units_alone_are_named_where_they_suffice(tmp_path, refused):
    """Turned by half it would lie on the other arm, nearer by less than a millimetre."""
    other = np.stack([X, -Y, Z], axis=1)
    error = refused(*words(write(tmp_path / "mine.obj", 1000 * other, F)))
    assert error.endswith("drawn in millimetres it lies on the body; pass --units mm, as it was drawn\n")


def test_wrong_units_and_axes_are_named_as_well(tmp_path, refused):
    path = write(tmp_path / "mine.obj", V, F)
    assert "it looks z up; this body is z up, not y up; pass --up z, as it was drawn" in refused(*words(path, "--up", "y"))
    assert "pass --units m, as it was drawn\n" in refused(*words(path, "--units", "mm"))
    assert "units = 'yd' is not allowed; allowed: m, dm, cm, mm, in, ft" in refused(*words(path, "--units", "yd"))
    assert "'sleeve' is no mesh" in refused(*words(path, "--garment", "sleeve", "--units", "mm"))
    evaluate = ("garment", "evaluate", tmp_path / "d", "--against", "line", "--up", "y")
    assert "'line' is no mesh" in refused(*evaluate)


def test_a_loose_sleeve_is_asked_about_its_axis_and_not_about_units(tmp_path, refused):
    loose = V + 0.06 * SLEEVE.vertex_normals
    path = write(tmp_path / "mine.obj", loose @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), F)
    assert "it looks y up; this body is z up; pass --up y, as it was drawn" in refused(*words(path))
    assert "m from body capsule; allowed: at most 0.03 m" in refused(*words(write(path, loose, F)))


@pytest.mark.parametrize("off_m", [0.0, 0.025])
def test_a_mirrored_sleeve_in_inches_is_not_said_to_be_turned(tmp_path, refused, off_m):
    """It lies on the right arm as on the left arm of one that faces backward."""
    path = write(tmp_path / "mine.obj", (V + off_m * SLEEVE.vertex_normals) * [-1, 1, 1] / 0.0254, F)
    assert refused(*words(path)).endswith("inches it lies on the body; pass --units in, as it was drawn\n")


def test_a_mesh_far_off_the_body_says_how_to_get_the_body(tmp_path, refused):
    path = write(tmp_path / "mine.obj", V + np.array([0.5, 0.0, 0.0]), F)
    assert "m from body capsule; allowed: at most 0.03 m; draw around what `haptics garment bodies --export" in refused(
        *words(path)
    )


@pytest.mark.parametrize(
    ("vertices", "faces", "notes"),
    [
        (V, F, []),
        ([*V, [0, 0.9, 0]], F, ["1 vertex of no triangle left out"]),
        (V, [*F, [0, 0, 1]], ["1 triangle without area left out"]),
        (V, [*F, F[0]], ["1 triangle given twice left out"]),
        (
            np.vstack([V, V]),
            np.vstack([F[:446], F[446:] + len(V)]),
            ["vertices of no triangle", "vertices along open edges welded"],
        ),
        (V, F[:, ::-1], ["it was inside out: all 892 triangles turned"]),
        (V * [1, -1, 1], F, ["it was inside out: all 892 triangles turned"]),
        (V, [*F[:-1], F[-1, ::-1]], ["1 triangle turned to face as the rest of 892 do"]),
    ],
    ids=["as is", "unused", "degenerate", "twice", "seam", "inside out", "mirrored", "one turned"],
)
def test_faults_are_mended_with_a_note(vertices, faces, notes, tmp_path):
    garment = opened(write(tmp_path / "mine.obj", vertices, np.asarray(faces)))
    assert len(garment.notes) == len(notes)
    for note, words_ in zip(garment.notes, notes, strict=True):
        assert note.startswith("mine.obj: ")
        assert words_ in note
    on_skin = SurfaceMesh(garment.on(BODY.straight_m), garment.triangles)
    assert on_skin.areas_m2.sum() == pytest.approx(SLEEVE.areas_m2.sum(), rel=0.1)  # 3 mm nearer to the bone
    axis = BODY.joints_m["elbow_l"] - BODY.joints_m["shoulder_l"]
    away = on_skin.centres_m - BODY.joints_m["elbow_l"]
    away -= np.outer(away @ axis, axis) / (axis @ axis)
    assert (np.einsum("ij,ij->i", away, on_skin.cross_m2) > 0).mean() > 0.95  # outward, seen from the bone


def drawn_around(body: Path) -> tuple[np.ndarray, np.ndarray]:
    """A sleeve by another program's means: the body sliced across the left arm, pushed outward."""
    drawn = trimesh.load_mesh(body, process=False)
    assert np.asarray(drawn.vertices) == pytest.approx(BODY.straight_m)
    shoulder, elbow = BODY.joints_m["shoulder_l"], BODY.joints_m["elbow_l"]
    along = (elbow - shoulder) / np.linalg.norm(elbow - shoulder)
    for origin, normal in ((elbow - 0.12 * along, along), (elbow + 0.12 * along, -along)):
        drawn = drawn.slice_plane(origin, normal)
    drawn.merge_vertices()
    arm = max(drawn.split(only_watertight=False), key=lambda piece: piece.vertices[:, 0].mean() * (len(piece.faces) > 100))
    return np.asarray(arm.vertices + 0.004 * arm.vertex_normals), np.asarray(arm.faces)


@pytest.mark.slow
def test_a_sleeve_drawn_around_the_exported_body_is_designed_and_its_notes_kept(tmp_path, answer, command, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)  # pictures take most of the time
    body = answer("garment", "bodies", "--export", tmp_path / "body.obj")
    assert (body["units"], body["up"], body["faces"], body["pose"], body["notes"]) == ("m", "z", "-y", "straight", [])
    assert (tmp_path / "body.obj").read_text().startswith("# body capsule, straight; metres, z up, facing -y")
    (x, y, z), faces = (lambda v, f: (v.T, f))(*drawn_around(tmp_path / "body.obj"))
    path = write(tmp_path / "mine.obj", 1000 * np.stack([x, z, -y], axis=1), faces[:, ::-1])
    out = ("--out", tmp_path / "d")
    monkeypatch.setattr(job, "FAST_VERTICES", 100)
    code, text, error = command(*words(path, "--units", "mm", "--up", "y", *out, "--json"))
    made = json.loads(text)
    slow = f"mine has {made['vertices']} vertices: about 0.0"
    assert code == 0
    assert error.startswith(f"note: {slow}")  # before anything takes long
    assert made["steps"] == made["converged_steps"]
    assert abs(made["coverage"] - 0.98) <= 0.003
    note = f"mine.obj: it was inside out: all {len(faces)} triangles turned"
    assert (made["units"], made["up"], made["notes"][0]) == ("mm", "y", note)
    assert made["notes"][1].startswith(slow)
    assert json.loads((tmp_path / "d" / "design.json").read_text())["notes"] == made["notes"]
    code, text, _ = command("garment", "evaluate", tmp_path / "d", "--steps", "1")
    assert code == 0
    assert f"note: {note}" in text
    assert answer("garment", "export", tmp_path / "d", "--out", tmp_path / "cut")["notes"] == [note]
    assert "it looks y up; this body is z up" in command(*words(path, *out, "--resume", "--units", "mm"))[2]


def test_a_bent_body_is_exported_to_look_at(tmp_path, answer, refused):
    words_ = ("garment", "bodies", "--export", tmp_path / "bent.obj")
    body = answer(*words_, "--motion", "elbow_flexion", "--angle-deg", "90", "--phenotype", "girth=1.1")
    assert body["pose"] == "elbow_flexion by 90 degrees"
    assert "drawn around the straight body" in body["notes"][0]
    assert "exists" in refused(*words_)
    assert "suffix of b.stl = '.stl' is not allowed; allowed: .obj" in refused(
        "garment", "bodies", "--export", tmp_path / "b.stl"
    )
    assert "allowed 1 to 120 deg" in refused(*words_, "--force", "--motion", "elbow_flexion", "--angle-deg", "170")
    assert "without a motion" in refused(*words_, "--force", "--angle-deg", "20")
    assert "only with --export" in refused("garment", "bodies", "--motion", "slouch")


def test_a_mask_drawn_in_other_units_is_named(tmp_path, refused, answer):
    path = write(tmp_path / "mask.obj", 100 * V, F[:300])
    given = ("garment", "evaluate", path, "--garment", "sleeve", "--level", "coarse", "--motion", "elbow_flexion", "--steps", "1")
    assert "pass --units cm, as it was drawn" in refused(*given)
    data = answer(*given, "--units", "cm")
    assert 0.2 < data["coverage"] < 0.6
    assert data["notes"] == ["mask.obj: 296 vertices of no triangle left out"]
