"""Flattening: exact where a surface can be developed, the known least distortion where it cannot, never a flipped triangle."""

import numpy as np
import pytest
from analytic_garments import cap, nothing, three_openings, tube

from haptics.errors import InputError
from haptics.garments.mesh import SurfaceMesh
from haptics.garments.pattern.flatten import _area_ratios, _boundary, _on_a_circle, distortion, flatten, gradients
from haptics.garments.pattern.seams import cut_to_fit

FRONT, BACK = np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0])


def panels(garment: SurfaceMesh, max_distortion=1.0):
    return [flat.panel.mesh for flat in cut_to_fit(garment, nothing(garment), FRONT, BACK, max_distortion, 8)[1]]


def lengths(mesh: SurfaceMesh, points):
    return np.linalg.norm(points[mesh.edges[:, 0]] - points[mesh.edges[:, 1]], axis=1)


def test_a_cylinder_develops_exactly():
    (panel,) = panels(tube())
    flat = flatten(panel)
    np.testing.assert_allclose(lengths(panel, flat), lengths(panel, panel.vertices_m), rtol=1e-6)
    assert distortion(panel, flat).largest_length < 1e-6
    # Its width is the circumference of the 36-sided prism.
    assert np.ptp(flat @ np.linalg.svd(flat - flat.mean(axis=0))[2].T, axis=0).min() == pytest.approx(
        36 * 0.1 * np.sin(np.pi / 36), rel=2e-3
    )


def test_a_cone_develops_but_for_the_angle_that_the_mesh_lacks():
    mesh = tube(top_m=0.03)
    (panel,) = panels(mesh)
    # Around a vertex of a staggered mesh on a cone the angles do not quite make a full turn. The lack is the curvature that
    # cannot be laid flat; lengths are off by no more than its sum.
    angles = np.zeros(len(panel.vertices_m))
    for i in range(3):
        a, b, c = (panel.vertices_m[panel.triangles[:, (i + k) % 3]] for k in range(3))
        cosine = np.einsum("ij,ij->i", b - a, c - a) / np.linalg.norm(b - a, axis=1) / np.linalg.norm(c - a, axis=1)
        np.add.at(angles, panel.triangles[:, i], np.arccos(cosine))
    inner = np.setdiff1d(np.arange(len(angles)), panel.boundary_edges)
    lack = np.abs(2 * np.pi - angles[inner]).sum()
    assert lack < 1e-2
    assert distortion(panel, flatten(panel)).largest_length < max(1e-6, lack)


def test_a_cap_of_a_sphere_is_distorted_as_theory_says():
    """The best radial map r(t) of a cap with stretches s1 = r'/R, s2 = r / (R sin t), found here by quadrature and descent in one
    dimension, on the same energy: another discretisation of the same problem."""
    from scipy.optimize import minimize

    half_angle, radius = np.deg2rad(40.0), 0.1
    disc = cap(40.0, radius, rings=30)
    flat = flatten(disc)
    nodes = np.linspace(0, half_angle, 201)
    middle = 0.5 * (nodes[1:] + nodes[:-1])
    weight = np.sin(middle) / np.sin(middle).sum()

    def stretches(r):
        r = np.concatenate([[0.0], r])
        return np.diff(r) / np.diff(nodes), 0.5 * (r[1:] + r[:-1]) / np.sin(middle)

    def energy(r):
        """With its slope by each radius."""
        s1, s2 = stretches(r)
        if min(s1.min(), s2.min()) <= 0:
            return np.inf, np.zeros_like(r)
        by_s1, by_s2 = weight * (2 * s1 - 2 * s1**-3) / np.diff(nodes), weight * (s2 - s2**-3) / np.sin(middle)
        slope = np.concatenate([[0.0], by_s1 + by_s2]) + np.concatenate([by_s2 - by_s1, [0.0]])
        return weight @ (s1**2 + s2**2 + s1**-2 + s2**-2), slope[1:]

    options = {"maxiter": 20_000, "maxfun": 10**6, "ftol": 1e-14}
    best = minimize(energy, nodes[1:], jac=True, method="L-BFGS-B", options=options).x
    s1, s2 = stretches(best)
    scale = np.sqrt(1 / (weight @ (s1 * s2)))
    s1, s2 = s1 * scale, s2 * scale
    expected = np.sqrt(weight @ (0.5 * ((s1 - 1) ** 2 + (s2 - 1) ** 2)))
    assert distortion(disc, flat).rms_length == pytest.approx(expected, rel=0.03)
    assert distortion(disc, flat).largest_stretch == pytest.approx(max(s1.max(), s2.max()), abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("mesh", [tube(bulge=0.03), three_openings(), cap(80.0)], ids=["barrel", "shorts", "cap"])
def test_nothing_is_flipped_and_the_area_is_kept(mesh):
    for panel in panels(mesh):
        flat = flatten(panel)
        corners = flat[panel.triangles]
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        areas = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
        assert areas.min() > 0
        assert areas.sum() == pytest.approx(panel.areas_m2.sum(), rel=1e-9)


def test_the_distortion_that_is_reported_is_that_of_a_known_map():
    (panel,) = panels(tube())
    flat = flatten(panel)
    turned = distortion(panel, flat @ np.array([[0.0, 1.0], [-1.0, 0.0]]))
    assert turned.largest_length < 1e-6
    stretched = distortion(panel, flat @ np.diag([1.1, 0.8]))
    assert stretched.largest_stretch == pytest.approx(1.1, abs=1e-6)
    assert stretched.smallest_stretch == pytest.approx(0.8, abs=1e-6)
    assert stretched.rms_length == pytest.approx(np.sqrt((0.1**2 + 0.2**2) / 2), abs=1e-6)
    assert stretched.area == pytest.approx(0.12, abs=1e-6)
    assert stretched.largest_area == pytest.approx(0.12, abs=1e-6)
    assert stretched.largest_length == pytest.approx(0.2, abs=1e-6)


def test_the_map_to_a_circle_flips_nothing_and_can_be_flattened_from():
    disc = cap(150.0)
    circle = _on_a_circle(disc, _boundary(disc))
    assert _area_ratios(disc, circle).min() > 0
    assert np.linalg.norm(circle, axis=1).max() == pytest.approx(1.0)
    assert np.linalg.det(gradients(disc, flatten(disc))).min() > 0


def test_what_is_no_disc_is_refused():
    with pytest.raises(InputError, match=r"Euler number 0 .* expected a disc"):
        flatten(tube())
