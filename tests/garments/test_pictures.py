"""Pictures of garments: the renderer against shapes whose outlines are known, and pictures that lose nothing at their edges."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="extra `report`")

from analytic_garments import tube
from matplotlib.image import imread

from haptics.errors import InputError
from haptics.garments.bodies import open_body
from haptics.garments.design.designs import DesignSequence, DesignStep, Reached
from haptics.garments.design.rating import Densities
from haptics.garments.mesh import SurfaceMesh
from haptics.garments.views import pictures
from haptics.garments.views.pictures import (
    REINFORCED_COLOUR,
    brightest,
    draw_density,
    draw_energy,
    draw_motion,
    draw_sequence,
    spread_out,
)
from haptics.garments.views.shading import DARKEST, Painted, View, framed, shaded

RED, GREEN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def square(side_m: float, y_m: float, colour: np.ndarray) -> Painted:
    """Upright, facing the front (-y)."""
    half = side_m / 2
    corners = np.array([[-half, y_m, -half], [half, y_m, -half], [half, y_m, half], [-half, y_m, half]])
    return Painted(SurfaceMesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), np.tile(colour, (2, 1)))


FROM_FRONT = View(0.0, 0.0, np.zeros(3), 0.3, 0.2)


def test_a_square_has_the_size_it_has():
    picture = shaded([square(0.1, 0.0, RED)], FROM_FRONT, 1000)
    assert picture.shape == (200, 300, 4)
    opaque = picture[..., 3] > 0.5
    assert opaque.sum() == 100 * 100
    assert opaque[50:150, 100:200].all()


def test_half_a_pixel_is_half_opaque():
    picture = shaded([square(0.1 + 2 / 3 * 1e-3, 0.0, RED)], FROM_FRONT, 1000)
    # a third of a pixel, one ray of three, is added on every side
    assert picture[100, 99, 3] == pytest.approx(1 / 3)
    assert picture[100, 100, 3] == 1.0


def test_what_is_nearer_hides_what_is_behind_in_any_order():
    near, far = square(0.05, -0.1, RED), square(0.1, 0.0, GREEN)
    one, other = shaded([near, far], FROM_FRONT, 500), shaded([far, near], FROM_FRONT, 500)
    assert np.array_equal(one, other)
    assert one[50, 75, 0] > 0
    assert one[50, 75, 1] == 0
    assert one[50, 55, 1] > 0


def test_cloth_a_little_below_the_skin_is_still_in_front():
    skin, cloth = square(0.1, 0.0, GREEN), square(0.1, 0.003, RED)
    assert shaded([skin, cloth], FROM_FRONT, 300)[30, 45, 1] > 0
    assert shaded([skin, Painted(cloth.mesh, cloth.colours, lift_m=0.006)], FROM_FRONT, 300)[30, 45, 0] > 0


def test_shading_keeps_the_hue_and_never_goes_dark():
    mesh = tube(radius_m=0.05, length_m=0.2)
    picture = shaded(
        [Painted(mesh, np.tile([0.8, 0.4, 0.2], (len(mesh.triangles), 1)))], framed(mesh.vertices_m, 20.0, 10.0), 500
    )
    seen = picture[picture[..., 3] == 1.0][:, :3]
    assert np.allclose(seen[:, 0] / seen[:, 1], 2.0)
    assert seen[:, 0].min() >= 0.8 * DARKEST - 1e-9
    assert seen[:, 0].max() > 0.7
    assert np.ptp(seen[:, 0]) > 0.2


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.0), (35.0, 12.0), (145.0, 12.0), (270.0, -60.0)])
def test_views_are_right_handed_and_hold_all_points(azimuth, elevation):
    points = np.random.default_rng(3).normal(size=(50, 3))
    view = framed(points, azimuth, elevation)
    assert np.allclose(view.axes @ view.axes.T, np.eye(3))
    assert np.linalg.det(view.axes) == pytest.approx(1.0)
    seen = np.abs((points - view.centre_m) @ view.axes.T)[:, :2]
    assert seen.max(axis=0) == pytest.approx(np.array([view.width_m, view.height_m]) / 2 / 1.12)


def test_front_is_where_the_body_faces_and_its_left_is_on_the_right_of_the_picture():
    view = View(0.0, 0.0, np.zeros(3), 1.0, 1.0)
    assert np.allclose(view.axes[2], [0, -1, 0])
    assert np.allclose(view.axes[0], [1, 0, 0])


def test_the_top_of_the_scale_is_below_two_percent_of_the_area():
    density, areas = np.arange(100.0), np.ones(100)
    assert brightest(density, areas) == 97.0
    areas[-1] = 100.0  # half of the area is the densest triangle
    assert brightest(density, areas) == 99.0
    assert brightest(np.zeros(4), np.ones(4)) > 0  # a colour bar needs a length


def test_designs_shown_fall_by_equal_factors_from_first_to_last():
    coverages = [0.985**k for k in range(127)] + [0.985**126] * 10
    shown = spread_out(coverages, 6)
    assert (shown[0], shown[-1], len(shown)) == (0, 136, 6)
    assert np.diff(np.log([coverages[k] for k in shown])) == pytest.approx(np.log(coverages[-1]) / 5, abs=0.02)
    assert spread_out([1.0], 6) == [0]


# Pictures of a design, without a simulation: only what is drawn matters here.


@pytest.fixture(scope="module")
def worn():
    body = open_body("capsule")
    from haptics.garments.bodies import MOTIONS
    from haptics.garments.garment import cut_garment

    garment = cut_garment(body, "sleeve", "coarse")
    rest = SurfaceMesh(garment.on(body.straight_m), garment.triangles)
    simulation = SimpleNamespace(rest=rest, areas_m2=rest.areas_m2)
    motion = MOTIONS["elbow_flexion"]
    posed_m = lambda angle: body.posed_m(motion.pose(angle))  # noqa: E731
    return SimpleNamespace(body=body, garment=garment, motion=motion, angle_deg=90.0, simulation=simulation, posed_m=posed_m)


@pytest.fixture(scope="module")
def sequence(worn):
    triangles = len(worn.garment.triangles)
    steps = []
    for k in range(60):
        coverage = 0.97**k
        design = np.arange(triangles) < coverage * triangles
        steps.append(DesignStep(design, coverage, 1.0 - 0.005 * k, 1 + 0.02 * k, 1 + 0.03 * k, 1e-8, 4))
    state = Reached(worn.simulation.rest.vertices_m, np.zeros(triangles))
    return DesignSequence(tuple(steps), 0.97**59, Densities(10.0, 10.0), state, state, True)


def energies(worn):
    return worn.garment.on(worn.posed_m(90.0)), np.linspace(0.0, 1e-3, len(worn.garment.triangles))


def drawn(kind: str, worn, sequence, path, force=False):
    if kind == "sequence":
        return draw_sequence(worn, sequence, path, force)
    if kind == "density":
        return draw_density(sequence, {"line": 0.6, "x": None}, "sleeve against elbow_flexion", path, force)
    if kind == "energy":
        positions_m, energy_j = energies(worn)
        return draw_energy(worn, sequence.final.design, positions_m, energy_j, "sleeve", path, force)
    angles = np.linspace(0, 90, 10)
    curve = SimpleNamespace(angles_deg=angles, energy_j=angles**2 / 1e4, torque_n_m=angles / 50)
    return draw_motion({"step 59": curve, "x": curve}, "sleeve", path, force)  # pyright: ignore[reportArgumentType]


KINDS = ("sequence", "density", "energy", "motion")


@pytest.fixture(scope="module", params=KINDS)
def picture(request, worn, sequence, tmp_path_factory):
    """One picture of each kind: what it is, and its file."""
    return request.param, drawn(request.param, worn, sequence, tmp_path_factory.mktemp("pictures") / f"{request.param}.png")


@pytest.mark.slow
def test_nothing_is_cut_off_at_the_edges(picture):
    pixels = imread(picture[1])[..., :3]
    for edge in (pixels[:2], pixels[-2:], pixels[:, :2], pixels[:, -2:]):
        assert edge.min() == 1.0
    assert (pixels < 0.9).any(axis=2).mean() > 0.02  # not an empty page


@pytest.mark.slow
def test_the_same_design_gives_the_same_bytes_and_is_not_overwritten_unasked(picture, worn, sequence, monkeypatch):
    kind, path = picture
    one = path.read_bytes()
    assert drawn(kind, worn, sequence, path, force=True).read_bytes() == one
    monkeypatch.setattr(pictures, "PIXELS", 60)
    with pytest.raises(InputError, match="--force"):
        drawn(kind, worn, sequence, path)
    assert path.read_bytes() == one


def test_less_coverage_is_less_blue(worn, sequence, tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "PIXELS", 200)
    pixels = imread(draw_sequence(worn, sequence, tmp_path / "one.png"))[..., :3]
    hue = pixels / np.maximum(pixels.max(axis=2, keepdims=True), 1e-9)
    blue = np.abs(hue - REINFORCED_COLOUR / REINFORCED_COLOUR.max()).max(axis=2) < 0.05
    sixths = [part.sum() for part in np.array_split(blue, 6, axis=1)]
    assert sixths == sorted(sixths, reverse=True)
    assert sixths[0] > 3 * sixths[-1]


@pytest.mark.parametrize("kind", KINDS)
def test_a_missing_extra_is_named(kind, worn, sequence, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(InputError, match=r"pip install '\.\[report\]'"):
        drawn(kind, worn, sequence, tmp_path / "one.png")
    assert not list(tmp_path.iterdir())
