"""Panels laid flat with as little distortion as can be had (thesis 5.7: developed onto a flat surface).

A least-squares conformal map to start with, then SLIM on the symmetric Dirichlet energy, which keeps every triangle's
orientation. A panel that can be developed stays exact. The scale is 1:1: the total area is kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from haptics.errors import InputError
from haptics.garments.cut.coarsening import libigl
from haptics.garments.mesh import Floats, SurfaceMesh

SLIM_STEPS, MAX_SLIM_STEPS = 3, 90
SETTLED = 1e-4
"""Iterations end when no stretch has changed by more than this in three steps."""


@dataclass(frozen=True)
class Distortion:
    """What flattening did to lengths and areas. A stretch is the ratio of a flat length to that on the body.

    :param smallest_stretch: smallest over triangles and directions; 1 where nothing is distorted.
    :param largest_stretch: largest.
    :param rms_length: root mean square, by area, of (stretch - 1) in the two principal directions.
    :param area: sum of the triangles' area changes without sign, over the area.
    :param largest_area: largest relative change of a triangle's area.
    """

    smallest_stretch: float
    largest_stretch: float
    rms_length: float
    area: float
    largest_area: float

    @property
    def largest_length(self) -> float:
        """Largest relative change of a length, of either sign."""
        return max(self.largest_stretch - 1.0, 1.0 - self.smallest_stretch)


def flatten(disc: SurfaceMesh, settled: float = SETTLED) -> Floats:
    """Flat positions of a disc's vertices as seen from outside; the total area is kept.

    :param disc: a panel with one boundary loop and no hole.
    :param settled: end when no stretch changes by more than this in three iterations.
    :return: positions, m, ``(vertices, 2)``.
    :raises InputError: libigl is missing, the mesh is not a disc, or triangles are flipped.
    """
    igl = libigl()
    boundary = _boundary(disc)
    # SLIM wants lengths near 1: its step control has absolute limits.
    unit_m = float(np.sqrt(disc.areas_m2.sum()))
    scaled = disc.at(disc.vertices_m / unit_m)
    start = _conformal(igl, scaled, boundary)
    if _area_ratios(scaled, start).min() <= 0:
        start = _on_a_circle(scaled, boundary)
    flat = _area_kept(scaled, _min_distorted(igl, scaled, _area_kept(scaled, start), settled))
    flipped = int((_area_ratios(scaled, flat) <= 0).sum())
    if flipped:
        raise InputError(
            f"{disc.name}: {flipped} of {len(disc.triangles)} triangles are flipped when laid flat; "
            "a finer mesh or more panels may help"
        )
    return flat * unit_m


def gradients(disc: SurfaceMesh, flat_m: Floats) -> Floats:
    """d(flat)/d(body) in each triangle; columns: along its edge 01, and across.

    :param disc: the panel in space.
    :param flat_m: its flat positions, m, ``(vertices, 2)``.
    :return: gradients, no unit, ``(triangles, 2, 2)``.
    """
    a, b, c = (disc.vertices_m[disc.triangles[:, i]] for i in range(3))
    along = np.linalg.norm(b - a, axis=1)
    shift = np.einsum("ij,ij->i", c - a, b - a) / along
    height = 2 * disc.areas_m2 / along
    p, q, r = (flat_m[disc.triangles[:, i]] for i in range(3))
    first = (q - p) / along[:, None]
    second = (r - p - shift[:, None] * first) / height[:, None]
    return np.stack([first, second], axis=2)


def distortion(disc: SurfaceMesh, flat_m: Floats) -> Distortion:
    """How far the map from ``disc`` to ``flat_m`` is from keeping all lengths.

    :param disc: the panel in space.
    :param flat_m: its flat positions, m, ``(vertices, 2)``.
    :return: errors of lengths and areas, no unit.
    """
    gradient = gradients(disc, flat_m)
    stretches = np.linalg.svd(gradient, compute_uv=False)
    change = np.abs(np.linalg.det(gradient) - 1)
    share = disc.areas_m2 / disc.areas_m2.sum()
    return Distortion(
        smallest_stretch=float(stretches[:, 1].min()),
        largest_stretch=float(stretches[:, 0].max()),
        rms_length=float(np.sqrt(share @ ((stretches - 1) ** 2).mean(axis=1))),
        area=float(share @ change),
        largest_area=float(change.max()),
    )


def _boundary(disc: SurfaceMesh) -> list[int]:
    """The boundary loop, in the direction of the triangles."""
    following = {int(a): int(b) for a, b in disc.boundary_edges}
    euler = len(disc.vertices_m) - len(disc.edges) + len(disc.triangles)
    loop = [min(following)] if following else []
    while loop and (vertex := following[loop[-1]]) != loop[0]:
        loop.append(vertex)
    if euler != 1 or len(loop) != len(following):
        raise InputError(
            f"{disc.name}: a panel with Euler number {euler} and {len(following)} boundary edges, {len(loop)} of them "
            "in one loop, cannot be laid flat; expected a disc (Euler number 1, one loop)"
        )
    return loop


def _area_ratios(disc: SurfaceMesh, flat: Floats) -> Floats:
    return np.linalg.det(gradients(disc, flat))


def _area_kept(disc: SurfaceMesh, flat: Floats) -> Floats:
    return flat * np.sqrt(disc.areas_m2.sum() / (_area_ratios(disc, flat) @ disc.areas_m2))


def _conformal(igl: Any, disc: SurfaceMesh, boundary: list[int]) -> Floats:
    """Least-squares conformal, held at two boundary vertices that are far apart."""
    away = np.linalg.norm(disc.vertices_m[boundary] - disc.vertices_m[boundary[0]], axis=1)
    held = np.array([boundary[0], boundary[int(np.argmax(away))]], np.int64)
    flat, _ = igl.lscm(disc.vertices_m, disc.triangles, held, np.array([[0.0, 0.0], [away.max(), 0.0]]))
    return flat


def _on_a_circle(disc: SurfaceMesh, boundary: list[int]) -> Floats:
    """Tutte's map: boundary on a circle, every other vertex in the middle of its neighbours. It never flips a triangle."""
    from scipy.sparse import coo_matrix, diags_array
    from scipy.sparse.linalg import splu

    vertices = len(disc.vertices_m)
    a, b = disc.edges[:, 0], disc.edges[:, 1]
    ends = (np.concatenate([a, b]), np.concatenate([b, a]))
    neighbours = coo_matrix((np.ones(2 * len(a)), ends), shape=(vertices, vertices)).tocsr()
    laplacian = (diags_array(np.asarray(neighbours.sum(axis=1)).ravel()) - neighbours).tocsr()
    steps = np.linalg.norm(np.diff(disc.vertices_m[[*boundary, boundary[0]]], axis=0), axis=1)
    angle = 2 * np.pi * (np.cumsum(steps) - steps) / steps.sum()
    flat = np.zeros((vertices, 2))
    flat[boundary] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inner = np.setdiff1d(np.arange(vertices), boundary)
    if len(inner):
        pull = laplacian[inner][:, boundary] @ flat[boundary]
        flat[inner] = splu(laplacian[inner][:, inner].tocsc()).solve(-pull)
    return flat


def _min_distorted(igl: Any, disc: SurfaceMesh, start: Floats, settled: float) -> Floats:
    """SLIM from ``start`` until the stretches no longer change."""
    free, nowhere = np.zeros(0, np.int32), np.asfortranarray(np.zeros((0, 2)))
    corners = np.asfortranarray(disc.triangles.astype(np.int32))
    energy = igl.MappingEnergyType.SYMMETRIC_DIRICHLET
    slim = igl.slim_precompute(
        np.asfortranarray(disc.vertices_m), corners, np.asfortranarray(start), energy, free, nowhere, soft_p=0.0
    )
    flat = start
    for _ in range(0, MAX_SLIM_STEPS, SLIM_STEPS):
        before, flat = flat, np.array(igl.slim_solve(slim, SLIM_STEPS)[:, :2])
        change = np.linalg.svd(gradients(disc, flat), compute_uv=False) - np.linalg.svd(gradients(disc, before), compute_uv=False)
        if np.abs(change).max() < settled:
            break
    return flat
