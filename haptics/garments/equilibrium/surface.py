"""The body as a smooth surface (thesis eq. 5.1, 5.2): implicit moving least squares over its vertices.

    Phi(x) = sum n_k . (x - v_k) phi_k(x) / sum phi_k(x),    phi_k = (1 - |x - v_k|^2 / h_k^2)^4 within h_k

with h_k twice the mean length of the edges at v_k. Phi is negative inside. A point sees only body vertices that are near *along
the body at rest*: across a crease (the inner elbow, the armpit) a posed body has foreign skin close by, and mixing its normals
in would blunt the crease. So each point keeps a home, the body vertex nearest to it, found by walking from neighbour to
neighbour; the home's list reaches past the support of every phi_k, so that changing homes does not change Phi.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from haptics.errors import InputError
from haptics.garments.mesh import Floats, Ints, SurfaceMesh

NEIGHBOURS = 60
"""Body vertices that a home sees. Fewer truncate the support where the body's mesh is uneven."""


MIN_WEIGHT, FULL_WEIGHT = 1e-3, 1e-2
"""Below the minimum sum of the phi_k, at nine tenths of every support, the quotient is steep and meaningless: there is no skin.
Phi fades between the two: a jump from deep inside to no skin would be a cliff in the energy, which no step gets down."""


def neighbour_lists(rest: SurfaceMesh, count: int = NEIGHBOURS) -> Ints:
    """For each body vertex the ``count`` nearest others along the skin at rest, itself first.

    Near along the skin: within a few edges, then by distance. Where the mesh is too small to give so many, -1 fills up.

    :param rest: the body's mesh at rest.
    :param count: how many each list holds, itself included.
    :return: vertex numbers, ``(vertices, count)``.
    """
    from scipy.sparse import csr_array

    n = len(rest.vertices_m)
    edges = rest.edges
    ones = np.ones(len(edges))
    step = csr_array((ones, (edges[:, 0], edges[:, 1])), shape=(n, n))
    step = (step + step.T + csr_array((np.ones(n), (np.arange(n), np.arange(n))), shape=(n, n))).tocsr()
    two = (step @ step).tocsr()
    five = (two @ two @ step).tocsr()
    owner = np.repeat(np.arange(n), np.diff(five.indptr))
    distance = np.linalg.norm(rest.vertices_m[owner] - rest.vertices_m[five.indices], axis=1)
    distance[owner == five.indices] = -1.0
    return _nearest_first(five.indptr, five.indices, distance, count)


class ImplicitBody:
    """A posed body's smooth surface.

    :param posed: the body's mesh in its pose.
    :param lists: the vertices near each body vertex, from ``neighbour_lists`` of the body at rest, ``(body vertices, count)``.
    :raises InputError: lists for another body.
    """

    def __init__(self, posed: SurfaceMesh, lists: Ints):
        if len(lists) != len(posed.vertices_m):
            raise InputError(
                f"{posed.name}: neighbour lists for {len(lists)} vertices; expected {len(posed.vertices_m)}, one for each vertex"
            )
        self.vertices_m = posed.vertices_m
        self.normals = posed.vertex_normals
        lengths = np.linalg.norm(posed.vertices_m[posed.edges[:, 0]] - posed.vertices_m[posed.edges[:, 1]], axis=1)
        count = np.bincount(posed.edges.ravel(), minlength=len(posed.vertices_m))
        total = np.bincount(posed.edges.ravel(), np.repeat(lengths, 2), minlength=len(posed.vertices_m))
        self.support_m: Floats = 2.0 * total / np.maximum(count, 1)
        self.lists = lists
        self._near = _within_reach(posed.vertices_m, self.support_m, lists)

    def walk_home(self, points_m: Floats, homes: Ints) -> Ints:
        """The body vertex nearest to each point, going downhill from ``homes`` along the skin.

        :param points_m: the points, m, ``(points, 3)``.
        :param homes: a body vertex near each, ``(points,)``.
        :return: body vertices, ``(points,)``.
        """
        return _walk(points_m, homes, self.vertices_m, self.lists)

    def distance_m(self, points_m: Floats, homes: Ints) -> Floats:
        """Phi at points with their homes (eq. 5.1).

        :param points_m: the points, m, ``(points, 3)``.
        :param homes: the body vertex nearest to each, ``(points,)``.
        :return: Phi, m, negative inside, ``(points,)``; +inf beyond every support, where nothing is felt.
        """
        return _imls(points_m, homes, self.vertices_m, self.normals, self.support_m, self._near, 0)[0]

    def distance_and_slope(self, points_m: Floats, homes: Ints) -> tuple[Floats, Floats]:
        """Phi and its gradient.

        :param points_m: the points, m, ``(points, 3)``.
        :param homes: the body vertex nearest to each, ``(points,)``.
        :return: Phi, m, ``(points,)``; gradient, no unit, ``(points, 3)``, zero where Phi is infinite.
        """
        return _imls(points_m, homes, self.vertices_m, self.normals, self.support_m, self._near, 1)[:2]

    def distance_and_curvature(self, points_m: Floats, homes: Ints) -> tuple[Floats, Floats, Floats]:
        """Phi, its gradient and its Hessian.

        :param points_m: the points, m, ``(points, 3)``.
        :param homes: the body vertex nearest to each, ``(points,)``.
        :return: Phi, m, ``(points,)``; gradient, no unit, ``(points, 3)``; Hessian, 1/m, ``(points, 3, 3)``; both zero where Phi
            is infinite.
        """
        return _imls(points_m, homes, self.vertices_m, self.normals, self.support_m, self._near, 2)

    def project(self, points_m: Floats, homes: Ints) -> tuple[Floats, Ints]:
        """Points moved along the gradient onto Phi = 0.

        :param points_m: the points, m, ``(points, 3)``.
        :param homes: a body vertex near each, ``(points,)``.
        :return: the points there, m, ``(points, 3)``, and their homes, ``(points,)``.
        :raises InputError: a point that is not within the surface's reach; the message names it.
        """
        points, homes = np.array(points_m), self.walk_home(points_m, homes)
        for _ in range(40):
            phi, gradient = self.distance_and_slope(points, homes)
            lost = np.flatnonzero(~np.isfinite(phi))
            if len(lost):
                where = "({:.4f}, {:.4f}, {:.4f}) m".format(*points[lost[0]])
                raise InputError(
                    f"vertex {lost[0]} at {where} is beyond the reach of the body's surface; move it nearer to the skin"
                )
            if np.abs(phi).max() < 1e-12:
                break
            points = points - (phi / np.maximum(np.einsum("ij,ij->i", gradient, gradient), 0.25))[:, None] * gradient
            homes = self.walk_home(points, homes)
        return points, homes


def nearest_vertices(points_m: Floats, vertices_m: Floats) -> NDArray[np.int64]:
    """The nearest of some vertices to each point: the first homes, in a pose where nothing folds.

    :param points_m: the points, m, ``(points, 3)``.
    :param vertices_m: the body's vertices, m, ``(vertices, 3)``.
    :return: vertex numbers, ``(points,)``.
    """
    from scipy.spatial import KDTree

    return np.asarray(KDTree(vertices_m).query(points_m)[1], dtype=np.int64)


@njit(cache=True)
def _nearest_first(indptr, indices, distance, count):
    """Each row's ``count`` nearest, of two equally far the one with the lower number first; -1 fills up."""
    lists = np.full((len(indptr) - 1, count), -1, np.int64)
    far = np.empty(count)
    for row in range(len(lists)):
        kept = 0
        for entry in range(indptr[row], indptr[row + 1]):
            d, k = distance[entry], indices[entry]
            if kept == count and (d > far[-1] or (d == far[-1] and k > lists[row, -1])):
                continue
            at = min(kept, count - 1)
            while at > 0 and (far[at - 1] > d or (far[at - 1] == d and lists[row, at - 1] > k)):
                far[at], lists[row, at] = far[at - 1], lists[row, at - 1]
                at -= 1
            far[at], lists[row, at] = d, k
            kept = min(kept + 1, count)
    return lists


@njit(cache=True)
def _within_reach(vertices, support, lists):
    """The lists without what a point can feel only where it is itself more than half a support away from its home."""
    out = np.full_like(lists, -1)
    for home in range(len(vertices)):
        kept = 0
        for k in lists[home]:
            if k < 0:
                break
            d = sqrt(
                (vertices[home, 0] - vertices[k, 0]) ** 2
                + (vertices[home, 1] - vertices[k, 1]) ** 2
                + (vertices[home, 2] - vertices[k, 2]) ** 2
            )
            if d < support[k] + 0.5 * support[home]:
                out[home, kept] = k
                kept += 1
    return out


@njit(cache=True)
def _walk(points, homes, vertices, lists):
    out = homes.copy()
    for i in range(len(points)):
        home = homes[i]
        while True:
            best, nearest = home, np.inf
            for k in lists[home]:
                if k < 0:
                    break
                d = (
                    (points[i, 0] - vertices[k, 0]) ** 2
                    + (points[i, 1] - vertices[k, 1]) ** 2
                    + (points[i, 2] - vertices[k, 2]) ** 2
                )
                if d < nearest:
                    best, nearest = k, d
            if best == home:
                break
            home = best
        out[i] = home
    return out


@njit(cache=True)
def _fade(weight):
    """0 at MIN_WEIGHT, 1 from FULL_WEIGHT, with its two derivatives by the weight: the skin ends without a step."""
    if weight >= FULL_WEIGHT:
        return 1.0, 0.0, 0.0
    width = FULL_WEIGHT - MIN_WEIGHT
    t = (weight - MIN_WEIGHT) / width
    return t**3 * (10 - 15 * t + 6 * t * t), 30 * t * t * (1 - t) ** 2 / width, 60 * t * (1 - t) * (1 - 2 * t) / width**2


@njit(cache=True)
def _imls(points, homes, vertices, normals, support, lists, order):
    n = len(points)
    phi = np.full(n, np.inf)
    gradient = np.zeros((n if order > 0 else 0, 3))
    hessian = np.zeros((n if order > 1 else 0, 3, 3))
    x = np.empty(3)
    top1 = np.empty(3)
    bottom1 = np.empty(3)
    top2 = np.empty((3, 3))
    bottom2 = np.empty((3, 3))
    for i in range(n):
        top = bottom = 0.0
        top1[:] = 0.0
        bottom1[:] = 0.0
        top2[:] = 0.0
        bottom2[:] = 0.0
        for k in lists[homes[i]]:
            if k < 0:
                break
            r2 = 0.0
            for a in range(3):
                x[a] = points[i, a] - vertices[k, a]
                r2 += x[a] * x[a]
            h2 = support[k] * support[k]
            if r2 >= h2:
                continue
            u = 1.0 - r2 / h2
            weight = u * u * u * u
            slope = -8.0 / h2 * u * u * u  # grad weight = slope x
            bend = 48.0 / (h2 * h2) * u * u
            plane = normals[k, 0] * x[0] + normals[k, 1] * x[1] + normals[k, 2] * x[2]
            top += plane * weight
            bottom += weight
            if order == 0:
                continue
            for a in range(3):
                top1[a] += normals[k, a] * weight + plane * slope * x[a]
                bottom1[a] += slope * x[a]
            if order == 1:
                continue
            for a in range(3):
                for b in range(a + 1):
                    curved = bend * x[a] * x[b] + (slope if a == b else 0.0)
                    top2[a, b] += slope * (normals[k, a] * x[b] + x[a] * normals[k, b]) + plane * curved
                    bottom2[a, b] += curved
        if bottom <= MIN_WEIGHT:
            continue
        phi[i] = top / bottom
        fade, fade1, fade2 = _fade(bottom)
        if order == 0:
            phi[i] *= fade
            continue
        for a in range(3):
            gradient[i, a] = (top1[a] - phi[i] * bottom1[a]) / bottom
        for a in range(3 if order > 1 else 0):
            for b in range(a + 1):
                plain = (top2[a, b] - gradient[i, a] * bottom1[b] - gradient[i, b] * bottom1[a] - phi[i] * bottom2[a, b]) / bottom
                hessian[i, a, b] = (
                    fade * plain
                    + fade1 * (gradient[i, a] * bottom1[b] + gradient[i, b] * bottom1[a] + phi[i] * bottom2[a, b])
                    + fade2 * phi[i] * bottom1[a] * bottom1[b]
                )
                hessian[i, b, a] = hessian[i, a, b]
        for a in range(3):
            gradient[i, a] = fade * gradient[i, a] + fade1 * phi[i] * bottom1[a]
        phi[i] *= fade
    return phi, gradient, hessian
