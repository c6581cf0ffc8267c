"""Meshes in scenes as other programs write them: units questioned, mended with a note, refused with the way out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_mesh import BOX_FACES, BOX_VERTICES, SIZE_M, ball

from haptics.errors import InputError
from haptics.scene.geometry.mesh import FAST_TRIANGLES, load_mesh
from haptics.scene.geometry.shapes import Box
from haptics.scene.model import read_scene

POINTS = np.random.default_rng(1).uniform(-0.1, 0.1, (300, 3))


def write(path: Path, vertices, faces) -> Path:
    lines = ["v {!r} {!r} {!r}".format(*map(float, v)) for v in vertices] + [
        "f {} {} {}".format(*(f + 1)) for f in np.asarray(faces)
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def scene(folder: Path, keys: str = 'units = "m", up = "y"'):
    shape = f'{{ kind = "mesh", file = "box.obj"{", " * bool(keys)}{keys} }}'
    text = f'summary = "one"\n[[objects]]\nname = "thing"\nshape = {shape}\n'
    return read_scene(text, "mine", "mine.toml", folder)


def is_the_box(mesh) -> bool:
    return bool(np.abs(mesh.distance(POINTS) - Box(SIZE_M).distance(POINTS)).max() < 1e-9)


def test_a_sound_mesh_gives_no_note(tmp_path):
    write(tmp_path / "box.obj", BOX_VERTICES, BOX_FACES)
    made = scene(tmp_path)
    assert made.notes == ()
    assert made.slow_notice is None
    assert is_the_box(made.object("thing").body.shape)


@pytest.mark.parametrize(
    ("unit", "scale", "word"), [("mm", 0.001, "millimetres"), ("cm", 0.01, "centimetres"), ("in", 0.0254, "inches")]
)
def test_another_unit_is_named_and_both_its_cures_work(tmp_path, unit, scale, word):
    write(tmp_path / "box.obj", BOX_VERTICES / scale, BOX_FACES)
    with pytest.raises(
        InputError, match=f"mine.toml:2: object .thing.: .*box.obj: it is .* m across; .* is it in {word}\\?"
    ) as refusal:
        scene(tmp_path, 'up = "y"')
    assert f'units = "{unit}" or scale = {scale:g}' in str(refusal.value)
    for keys in (f'units = "{unit}"', f"scale = {scale:g}"):
        made = scene(tmp_path, keys + ', up = "y"')
        assert is_the_box(made.object("thing").body.shape)
        assert made.notes == ()


def test_what_is_said_is_believed_with_a_note(tmp_path):
    write(tmp_path / "box.obj", BOX_VERTICES * 1000, BOX_FACES)
    for keys in ('units = "m"', "scale = 1"):
        made = scene(tmp_path, keys + ', up = "y"')
        assert made.notes == (
            "thing: box.obj: it is 100 m across; must be 0.002 to 3 m, as something to touch is; kept as given",
        )
        assert made.object("thing").body.shape.volume_m3 == pytest.approx(1e9 * np.prod(SIZE_M))


@pytest.mark.parametrize(
    ("keys", "unsaid"),
    [("", "in metres, y up"), ('up = "z"', "in metres"), ('units = "m"', "y up"), ("scale = 1", "y up")],
)
def test_what_is_not_said_is_noted_as_it_was_taken(tmp_path, keys, unsaid):
    write(tmp_path / "box.obj", BOX_VERTICES, BOX_FACES)
    wide, high, deep = (0.06, 0.03, 0.1) if "z" in keys else (0.06, 0.1, 0.03)
    assert scene(tmp_path, keys).notes == (
        f"thing: box.obj: taken to be {unsaid}, as its shape does not specify: {wide} m wide, {high} high, {deep} deep",
    )


@pytest.mark.parametrize(("size", "likely"), [(0.1, None), (0.9, None), (1.5, "centimetres"), (2.5, "centimetres")])
def test_a_possible_size_that_is_likelier_in_another_unit_is_asked_about(tmp_path, size, likely):
    write(tmp_path / "box.obj", BOX_VERTICES * size / 0.1, BOX_FACES)
    (note,) = scene(tmp_path, 'up = "y"').notes
    assert ("is it in " in note) == (likely is not None)
    assert likely is None or (likely in note and "or in" in note)
    assert scene(tmp_path).notes == ()


def test_a_mesh_that_lies_off_the_origin_of_its_file_says_so(tmp_path):
    write(tmp_path / "box.obj", BOX_VERTICES + np.array([0, 0, 0.5]), BOX_FACES)
    assert scene(tmp_path).notes == (
        "thing: box.obj: it lies 0.485 m from the origin of its file, which is what a scene places: its middle is at (0, 0, 0.5)",
    )
    write(tmp_path / "box.obj", BOX_VERTICES + np.array([0, 0.05, 0.1]), BOX_FACES)
    assert scene(tmp_path).notes == ()


def test_more_pieces_than_can_be_sorted_are_refused_in_time(tmp_path, monkeypatch):
    monkeypatch.setattr("haptics.scene.geometry.mesh.MAX_PIECES", 2)
    three = np.concatenate([BOX_VERTICES + np.array([k, 0, 0]) for k in (0, 0.2, 0.4)])
    path = write(tmp_path / "box.obj", three, np.concatenate([BOX_FACES + 8 * k for k in range(3)]))
    with pytest.raises(InputError, match="in 3 pieces; at most 2 are read; join it where it was made"):
        load_mesh(path)


def test_a_mesh_with_another_axis_up_is_turned(tmp_path):
    x, y, z = BOX_VERTICES.T
    write(tmp_path / "box.obj", np.stack([x, -z, y], axis=1), BOX_FACES)
    assert is_the_box(scene(tmp_path, 'up = "z"').object("thing").body.shape)
    write(tmp_path / "box.obj", np.stack([y, -x, z], axis=1), BOX_FACES)
    assert is_the_box(scene(tmp_path, 'up = "x"').object("thing").body.shape)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ('units = "km"', "units = 'km' in .*; allowed: m, dm, cm"),
        ('up = "w"', "up = 'w' in .*; allowed: x, y, z"),
        ('units = "mm", scale = 0.001', "both given; give one of them"),
        ("scale = 0", "scale = 0 in .*; allowed above 0"),
        ('repair = "yes"', "repair = 'yes' in .*; expected true or false"),
    ],
)
def test_keys_are_checked(tmp_path, keys, message):
    write(tmp_path / "box.obj", BOX_VERTICES, BOX_FACES)
    with pytest.raises(InputError, match=message):
        scene(tmp_path, keys)


@pytest.mark.parametrize(
    ("vertices", "faces", "notes"),
    [
        ([*BOX_VERTICES, [0, 0.9, 0]], BOX_FACES, ["1 vertex of no triangle left out"]),
        (BOX_VERTICES, [*BOX_FACES, [0, 0, 1]], ["1 triangle without area left out"]),
        (BOX_VERTICES, [*BOX_FACES, BOX_FACES[3]], ["1 triangle given twice left out"]),
        (
            BOX_VERTICES[BOX_FACES].reshape(-1, 3),
            np.arange(36).reshape(-1, 3),
            ["28 vertices along open edges welded to others within 1e-05 m"],
        ),
        (BOX_VERTICES, BOX_FACES[:, ::-1], ["it was inside out: 12 of 12 triangles turned"]),
        (BOX_VERTICES * [-1, 1, 1], BOX_FACES, ["it was inside out: 12 of 12 triangles turned"]),
        (BOX_VERTICES, [*BOX_FACES[:-1], BOX_FACES[-1, ::-1]], ["1 triangle turned to face as the rest of 12 do"]),
    ],
    ids=["unused", "degenerate", "twice", "seams", "inside out", "mirrored", "one turned"],
)
def test_faults_are_mended_with_a_note(tmp_path, vertices, faces, notes):
    write(tmp_path / "box.obj", vertices, np.asarray(faces))
    made = scene(tmp_path)
    assert made.notes == tuple(f"thing: box.obj: {note}" for note in notes)
    assert is_the_box(made.object("thing").body.shape)


def test_holes_are_counted_and_closed_on_request(tmp_path):
    write(tmp_path / "box.obj", BOX_VERTICES, BOX_FACES[3:])
    with pytest.raises(InputError, match=r"the mesh is open: 2 holes \(4 edges about .*; 3 edges about .*\); .*repair = true"):
        scene(tmp_path)
    made = scene(tmp_path, 'repair = true, units = "m", up = "y"')
    (note,) = made.notes
    assert note.startswith("thing: box.obj: 2 holes (4 edges about (-0.03, 0, 0); 3 edges about (0.03, ")
    assert note.endswith(" closed by flat caps")
    assert is_the_box(made.object("thing").body.shape)


def test_a_slit_where_an_edge_meets_two_is_closed_on_request(tmp_path):
    """A corner in the middle of its neighbour's edge: the hole has no area, and neither has its cap."""
    a, b, c = BOX_FACES[0]
    vertices = [*BOX_VERTICES, 0.5 * (BOX_VERTICES[a] + BOX_VERTICES[b])]
    write(tmp_path / "box.obj", vertices, np.array([[a, 8, c], [8, b, c], *BOX_FACES[1:]]))
    with pytest.raises(InputError, match="1 hole "):
        scene(tmp_path)
    assert is_the_box(scene(tmp_path, "repair = true").object("thing").body.shape)


def test_sizes_beyond_computing_are_refused_whatever_is_said(tmp_path):
    write(tmp_path / "box.obj", BOX_VERTICES * 1e300, BOX_FACES)
    with pytest.raises(InputError, match=r"size of mesh .*; allowed 0.0001 to 10000 m"):
        scene(tmp_path, 'units = "m"')


def test_a_name_that_no_file_can_have_is_refused():
    with pytest.raises(InputError, match="cannot be read: File name too long"):
        load_mesh(Path("a" * 5000 + ".obj"))


def test_a_sheet_of_loose_triangles_is_refused_in_time(tmp_path):
    """5,000 holes: counted at once, not each against all others."""
    rng = np.random.default_rng(2)
    corners = rng.uniform(-0.1, 0.1, (5_000, 1, 3)) + rng.uniform(-0.005, 0.005, (5_000, 3, 3))
    path = write(tmp_path / "box.obj", corners.reshape(-1, 3), np.arange(15_000).reshape(-1, 3))
    with pytest.raises(InputError, match=r"5000 holes \(3 edges about .* and 4997 more\)"):
        load_mesh(path)


def test_what_will_be_slow_is_said_with_its_cost_and_the_limit(tmp_path):
    fine = ball(16)
    assert len(fine.faces) > FAST_TRIANGLES
    write(tmp_path / "box.obj", fine.vertices_m, fine.faces)
    made = scene(tmp_path)
    assert made.slow_notice == (
        "960 triangles of meshes: about 1.92 ms a tick while the hand is near them, so that a second takes 1.92 s to compute; "
        "real time needs 500 at most"
    )
    assert made.notes == (made.slow_notice,)
