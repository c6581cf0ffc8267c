"""Masks from files: pictures land where the person sees them, surfaces where they lie, and any mask can be given an area."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bar_panel import tube

from haptics.errors import InputError
from haptics.garments.design.masks import mask_from_image, mask_from_list, mask_from_surface, read_mask, with_coverage
from haptics.garments.mesh import SurfaceMesh

TUBE = tube(60, 50, 0.04, 0.3)
X, Y, Z = TUBE.centres_m.T


def _picture(path: Path, ink: np.ndarray) -> Path:
    from matplotlib.image import imsave

    imsave(path, 1.0 - ink.astype(float), cmap="gray", vmin=0, vmax=1)
    return path


def test_picture_is_wrapped_around_as_seen_from_outside(tmp_path: Path) -> None:
    """The body faces -y, its left is +x: dark in the upper half, from the middle (front) a quarter to the right (its left)."""
    ink = np.zeros((40, 80), bool)
    ink[:20, 40:60] = True
    mask = mask_from_image(_picture(tmp_path / "drawn.png", ink), TUBE)
    expected = (Z > 0.15) & (X > 0) & (Y < 0)
    assert np.array_equal(mask, expected)


def test_edges_of_the_picture_meet_at_the_back(tmp_path: Path) -> None:
    ink = np.zeros((10, 60), bool)
    ink[:, :5] = ink[:, -5:] = True
    mask = mask_from_image(_picture(tmp_path / "drawn.png", ink), TUBE)
    assert np.array_equal(mask, (Y > 0) & (np.abs(np.arctan2(X, Y)) < np.radians(30)))


def test_picture_follows_a_leaning_limb(tmp_path: Path) -> None:
    """Leaning sideways, as an arm: the higher end is still at the top, the front in the middle."""
    lean = np.radians(60)
    turn = np.array([[np.cos(lean), 0, np.sin(lean)], [0, 1, 0], [-np.sin(lean), 0, np.cos(lean)]])
    ink = np.zeros((40, 80), bool)
    ink[:20, 40:60] = True
    path = _picture(tmp_path / "drawn.png", ink)
    leaning = TUBE.at(TUBE.vertices_m @ turn.T + [0.2, 0.1, 1.0])
    assert np.array_equal(mask_from_image(path, leaning), mask_from_image(path, TUBE))


def test_transparent_paper_is_white(tmp_path: Path) -> None:
    from matplotlib.image import imsave

    pixels = np.zeros((4, 4, 4))
    pixels[:2, :, 3] = 1.0
    imsave(tmp_path / "drawn.png", pixels)
    assert np.array_equal(mask_from_image(tmp_path / "drawn.png", TUBE), Z > 0.15)


def test_triangles_near_a_drawn_surface(tmp_path: Path) -> None:
    """A larger tube around the middle third, 3 mm off the garment."""
    drawn = tube(60, 10, 0.043, 0.1)
    path = tmp_path / "drawn.obj"
    rows = [f"v {x!r} {y!r} {z + 0.1!r}" for x, y, z in drawn.vertices_m.tolist()]
    rows += ["f " + " ".join(str(corner + 1) for corner in triangle) for triangle in drawn.triangles.tolist()]
    path.write_text("\n".join(rows) + "\n")
    mask = mask_from_surface(path, TUBE, near_m=0.0035)
    inner = np.hypot(X, Y)
    assert np.all(np.abs(Z[mask] - 0.15) < 0.05 + 0.0025)
    assert mask[(np.abs(Z - 0.15) < 0.05) & (inner > 0.0396)].all()
    with pytest.raises(InputError, match=r"nearest point is 0\.00\d+ m from the garment; expected one within 0\.001 m"):
        mask_from_surface(path, TUBE, near_m=0.001)


def test_lists_of_triangles(tmp_path: Path) -> None:
    text, numbers, design = tmp_path / "a.txt", tmp_path / "b.npz", tmp_path / "c.npz"
    text.write_text("# the front\n3\n5\n5\n")
    np.savez(numbers, triangles=np.array([3, 5]))
    np.savez(design, design=np.isin(np.arange(8), [3, 5]))
    for path in (text, numbers, design):
        assert np.flatnonzero(mask_from_list(path, 8)).tolist() == [3, 5]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.txt", "3\n8\n", "triangle 8 does not exist; allowed: 0 to 7"),
        ("a.txt", "-1\n", "triangle -1 does not exist"),
        ("a.txt", "3.5\n", "not a list of triangles"),
        ("a.txt", "1 2\n3 4\n", r"triangles are int64 of shape \(2, 2\); expected one row of whole numbers"),
        ("a.npz", {"design": np.ones(9, bool)}, r"design is bool of shape \(9,\); expected bool of shape \(8,\)"),
        ("a.npz", {"mask": np.ones(8, bool)}, "not a list of triangles"),
        ("a.npz", {"triangles": np.array([0.5])}, "triangles are float64"),
        ("a.npz", "text", "not a list of triangles"),
    ],
)
def test_lists_that_do_not_fit_are_refused(tmp_path: Path, name: str, content: object, message: str) -> None:
    path = tmp_path / name
    if isinstance(content, dict):
        np.savez(path, **content)
    else:
        path.write_text(str(content))
    with pytest.raises(InputError, match=message):
        mask_from_list(path, 8)


def test_file_is_read_by_its_ending(tmp_path: Path) -> None:
    path = _picture(tmp_path / "drawn.png", np.ones((4, 4), bool))
    assert read_mask(path, TUBE).all()
    (tmp_path / "drawn.txt").write_text("7\n")
    assert np.flatnonzero(read_mask(tmp_path / "drawn.txt", TUBE)).tolist() == [7]
    with pytest.raises(InputError, match=r"ending of drawn\.gif = '\.gif' is not allowed"):
        read_mask(tmp_path / "drawn.gif", TUBE)
    with pytest.raises(InputError, match=r"none\.png: not a readable picture"):
        read_mask(tmp_path / "none.png", TUBE)
    (tmp_path / "torn.png").write_bytes(path.read_bytes()[:50])
    with pytest.raises(InputError, match=r"torn\.png: not a readable picture"):
        read_mask(tmp_path / "torn.png", TUBE)


@pytest.mark.parametrize("name", ["empty.txt", "none.npz"])
def test_a_mask_that_reinforces_nothing_is_refused(name: str, tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    (tmp_path / "empty.txt").write_text("# none yet\n")
    np.savez(tmp_path / "none.npz", design=np.zeros(len(Z), bool))
    with pytest.raises(InputError, match=f"{name} reinforces nothing"):
        read_mask(tmp_path / name, TUBE)
    assert not len(recwarn)


def test_a_torn_archive_is_refused(tmp_path: Path) -> None:
    (tmp_path / "torn.npz").write_bytes(b"PK\x03\x04torn")
    with pytest.raises(InputError, match="not a list of triangles"):
        read_mask(tmp_path / "torn.npz", TUBE)


def test_garment_without_openings_cannot_take_a_picture(tmp_path: Path) -> None:
    path = _picture(tmp_path / "drawn.png", np.ones((4, 4), bool))
    one = SurfaceMesh(np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], float), np.array([[0, 1, 2]]), "patch")
    with pytest.raises(InputError, match="patch has 1 openings; a picture needs at least 2"):
        mask_from_image(path, one)


@pytest.mark.parametrize("coverage", [0.1, 0.25, 0.6])
def test_mask_is_grown_or_trimmed_evenly_to_an_area(coverage: float) -> None:
    """A ring of a quarter of the tube's length becomes a ring of another length about the same middle."""
    ring = np.abs(Z - 0.15) < 0.0375
    everything = np.ones(len(Z), bool)
    fitted = with_coverage(ring, TUBE, everything, coverage)
    assert TUBE.areas_m2[fitted].sum() / TUBE.areas_m2.sum() == pytest.approx(coverage, abs=0.5 / len(Z) + 1e-9)
    row = 0.3 / 50
    assert np.abs(Z[fitted] - 0.15).max() == pytest.approx(coverage * 0.15, abs=row)
    assert np.abs(Z[~fitted] - 0.15).min() == pytest.approx(coverage * 0.15, abs=row)


def test_mask_grows_only_where_reinforcement_is_allowed() -> None:
    allowed = Z < 0.2
    fitted = with_coverage(np.abs(Z - 0.15) < 0.0375, TUBE, allowed, 0.8)
    assert not fitted[~allowed].any()
    assert TUBE.areas_m2[fitted].sum() / TUBE.areas_m2[allowed].sum() == pytest.approx(0.8, abs=0.001)


def test_mask_without_a_border_cannot_be_fitted() -> None:
    everything = np.ones(len(Z), bool)
    for mask, what in ((everything, "everything"), (~everything, "nothing")):
        with pytest.raises(InputError, match=f"mask reinforces {what}"):
            with_coverage(mask, TUBE, everything, 0.2)
