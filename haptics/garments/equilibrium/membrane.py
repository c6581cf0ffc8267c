"""The cloth: a compressible neo-Hookean membrane that neither buckles nor pushes (thesis eq. 5.4 to 5.7, relaxed as in 5.4.2).

A triangle's deformation gradient F (3 x 2) has the principal stretches s1 >= s2 >= 0. With J = s1 s2 the taut sheet has, per rest
area (the constants carry the thickness, N/m),

    W(s1, s2) = mu/2 (s1^2 + s2^2 - 2) - mu log J + lambda/2 (log J)^2.

Cloth wrinkles instead of carrying compression, so W is relaxed (Pipkin's tension field):

    slack     s1 <= 1                 0
    wrinkled  s2 < w(s1)              W(s1, w(s1)), where w is the natural width: dW/ds2 (s1, w) = 0
    taut      otherwise               W(s1, s2)

The relaxed W has a continuous gradient, is finite for every F (log J is never met near J = 0), and pulls only. Energies, forces
and second derivatives are closed forms in s1, s2 and the six modes of F that they belong to: two stretches, a turn and a shear in
the plane, and two tilts out of it. Nothing decomposes F by iteration; a coincidence of s1 and s2 needs no special case.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, sqrt

import numpy as np
from numba import njit

from haptics.errors import InputError
from haptics.garments.mesh import Floats, Ints, SurfaceMesh

SLACK, WRINKLED, TAUT = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Membrane:
    """Triangles of cloth with their rest shape.

    :param triangles: vertex numbers, ``(triangles, 3)``.
    :param areas_m2: rest areas, m2, ``(triangles,)``.
    :param shape_per_m: gradients of the three corners' hat functions in the triangle's rest plane, 1/m, ``(triangles, 3, 2)``.
    """

    triangles: Ints
    areas_m2: Floats
    shape_per_m: Floats

    @classmethod
    def at_rest(cls, rest: SurfaceMesh) -> Membrane:
        """The membrane with a rest shape.

        :param rest: the mesh without stretch.
        :return: the membrane.
        """
        a, b, c = (rest.vertices_m[rest.triangles[:, i]] for i in range(3))
        along = np.linalg.norm(b - a, axis=1)
        first = (b - a) / along[:, None]
        shift = np.einsum("ij,ij->i", c - a, first)
        height = np.linalg.norm(c - a - shift[:, None] * first, axis=1)
        shape = np.zeros((len(rest.triangles), 3, 2))
        shape[:, 1, 0] = 1 / along
        shape[:, 1, 1] = -shift / (along * height)
        shape[:, 2, 1] = 1 / height
        shape[:, 0] = -shape[:, 1] - shape[:, 2]
        return cls(rest.triangles, rest.areas_m2, shape)

    def element_energy_j(self, positions_m: Floats, lame_n_m: Floats) -> Floats:
        """Strain energy of each triangle (eq. 5.7, relaxed).

        :param positions_m: positions of the vertices, m, ``(vertices, 3)``.
        :param lame_n_m: (lambda, mu) times thickness of each triangle, N/m, ``(triangles, 2)``.
        :return: energies, J, ``(triangles,)``.
        """
        return _energies(positions_m, self.triangles, self.areas_m2, self.shape_per_m, lame_n_m)

    def gradient_n(self, positions_m: Floats, lame_n_m: Floats) -> Floats:
        """Derivative of the whole energy by the positions: the force that must be applied at each vertex to hold it there.

        :param positions_m: positions of the vertices, m, ``(vertices, 3)``.
        :param lame_n_m: (lambda, mu) times thickness of each triangle, N/m, ``(triangles, 2)``.
        :return: forces, N, ``(vertices, 3)``.
        """
        return _gradient(positions_m, self.triangles, self.areas_m2, self.shape_per_m, lame_n_m)

    def element_hessians_n_m(self, positions_m: Floats, lame_n_m: Floats) -> Floats:
        """Second derivatives of each triangle's energy, corner by corner.

        :param positions_m: positions of the vertices, m, ``(vertices, 3)``.
        :param lame_n_m: (lambda, mu) times thickness of each triangle, N/m, ``(triangles, 2)``.
        :return: symmetric matrices, N/m, ``(triangles, 9, 9)``.
        """
        return _hessians(positions_m, self.triangles, self.areas_m2, self.shape_per_m, lame_n_m)

    def stretches(self, positions_m: Floats) -> Floats:
        """Principal stretches, larger first.

        :param positions_m: positions of the vertices, m, ``(vertices, 3)``.
        :return: stretches, 1 at rest, ``(triangles, 2)``.
        """
        return _stretches(positions_m, self.triangles, self.shape_per_m)

    def states(self, positions_m: Floats, lame_n_m: Floats) -> Ints:
        """Whether each triangle is slack, wrinkled or taut.

        :param positions_m: positions of the vertices, m, ``(vertices, 3)``.
        :param lame_n_m: (lambda, mu) times thickness of each triangle, N/m, ``(triangles, 2)``.
        :return: ``SLACK``, ``WRINKLED`` or ``TAUT``, ``(triangles,)``.
        """
        return _states(self.stretches(positions_m), lame_n_m)


def natural_width(stretch: float, lam_n_m: float, mu_n_m: float) -> float:
    """Width w at which a strip stretched by ``stretch`` has no stress across: mu (w^2 - 1) + lambda log(stretch w) = 0.

    :param stretch: length over rest length, above 0.
    :param lam_n_m: lambda times thickness, N/m, from 0.
    :param mu_n_m: mu times thickness, N/m, above 0.
    :return: w, width over rest width.
    :raises InputError: a stretch that is not positive, or constants outside lambda >= 0, mu > 0.
    """
    if not stretch > 0 or not mu_n_m > 0 or not lam_n_m >= 0:
        raise InputError(
            f"natural width of stretch {stretch}, lambda {lam_n_m}, mu {mu_n_m}; expected stretch > 0, lambda >= 0, mu > 0"
        )
    return sqrt(_natural_width_squared(log(stretch), lam_n_m, mu_n_m))


@njit(cache=True)
def _natural_width_squared(log_stretch, lam, mu):
    # In z = log w^2 the condition mu e^z + lambda z / 2 = mu - lambda log s1 is convex and rising: from a z above the root
    # Newton's steps come down to it and never past.
    z = max(0.0, -2.0 * log_stretch)
    for _ in range(60):
        grown = mu * exp(z)
        step = (grown + 0.5 * lam * z - mu + lam * log_stretch) / (grown + 0.5 * lam)
        z -= step
        if abs(step) <= 1e-15 * (1.0 + abs(z)):
            break
    return exp(z)


@njit(cache=True)
def _deformation(positions, corners, shape, f):
    for i in range(3):
        for j in range(2):
            f[i, j] = (
                positions[corners[0], i] * shape[0, j]
                + positions[corners[1], i] * shape[1, j]
                + positions[corners[2], i] * shape[2, j]
            )


@njit(cache=True)
def _principal(f):
    """(s1, s2, v1x, v1y): principal stretches and the first principal direction in the rest plane."""
    a = f[0, 0] * f[0, 0] + f[1, 0] * f[1, 0] + f[2, 0] * f[2, 0]
    d = f[0, 1] * f[0, 1] + f[1, 1] * f[1, 1] + f[2, 1] * f[2, 1]
    b = f[0, 0] * f[0, 1] + f[1, 0] * f[1, 1] + f[2, 0] * f[2, 1]
    half = 0.5 * (a - d)
    radius = sqrt(half * half + b * b)
    s1 = sqrt(0.5 * (a + d) + radius)
    nx = f[1, 0] * f[2, 1] - f[2, 0] * f[1, 1]
    ny = f[2, 0] * f[0, 1] - f[0, 0] * f[2, 1]
    nz = f[0, 0] * f[1, 1] - f[1, 0] * f[0, 1]
    area = sqrt(nx * nx + ny * ny + nz * nz)  # J itself: free of the cancellation in a d - b^2
    s2 = min(area / s1, s1) if s1 > 0.0 else 0.0
    if radius <= 1e-300:
        return s1, s2, 1.0, 0.0
    cosine, sine = half / radius, b / radius  # of twice the angle
    if cosine >= 0.0:
        vx = sqrt(0.5 * (1.0 + cosine))
        return s1, s2, vx, 0.5 * sine / vx
    vy = sqrt(0.5 * (1.0 - cosine))
    return s1, s2, 0.5 * sine / vy, vy


@njit(cache=True)
def _state(s1, s2, lam, mu):
    if s1 <= 1.0:
        return SLACK
    if s2 <= 0.0 or mu * (s2 * s2 - 1.0) + lam * (log(s1) + log(s2)) < 0.0:
        return WRINKLED
    return TAUT


@njit(cache=True)
def _density(s1, s2, lam, mu):
    state = _state(s1, s2, lam, mu)
    if state == SLACK:
        return 0.0
    log_s1 = log(s1)
    if state == WRINKLED:
        w2 = _natural_width_squared(log_s1, lam, mu)
        log_w = 0.5 * log(w2)
    else:
        w2 = s2 * s2
        log_w = log(s2)
    log_j = log_s1 + log_w
    # Near rest the terms cancel: s^2 - 1 - 2 log s is taken as one function of log s.
    return 0.5 * mu * (_above_log(log_s1) + _above_log(log_w)) + 0.5 * lam * log_j * log_j


@njit(cache=True)
def _above_log(log_s):
    """s^2 - 1 - 2 log s, without cancellation near s = 1."""
    x = 2.0 * log_s
    if abs(x) < 1e-3:
        return x * x * (0.5 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x / 120.0)))
    return exp(x) - 1.0 - x


@njit(cache=True)
def _energies(positions, triangles, areas, shapes, lame):
    out = np.empty(len(triangles))
    f = np.empty((3, 2))
    for e in range(len(triangles)):
        _deformation(positions, triangles[e], shapes[e], f)
        s1, s2, _, _ = _principal(f)
        out[e] = areas[e] * _density(s1, s2, lame[e, 0], lame[e, 1])
    return out


@njit(cache=True)
def _stretches(positions, triangles, shapes):
    out = np.empty((len(triangles), 2))
    f = np.empty((3, 2))
    for e in range(len(triangles)):
        _deformation(positions, triangles[e], shapes[e], f)
        out[e, 0], out[e, 1], _, _ = _principal(f)
    return out


@njit(cache=True)
def _states(stretches, lame):
    out = np.empty(len(stretches), dtype=np.int64)
    for e in range(len(stretches)):
        out[e] = _state(stretches[e, 0], stretches[e, 1], lame[e, 0], lame[e, 1])
    return out


@njit(cache=True)
def _tension_over_stretch(s1, s2, lam, mu):
    """(W1 / s1, W2 / s2): zero where the cloth does not pull."""
    state = _state(s1, s2, lam, mu)
    if state == SLACK:
        return 0.0, 0.0
    if state == WRINKLED:
        w2 = _natural_width_squared(log(s1), lam, mu)
        return mu * (1.0 - w2 / (s1 * s1)), 0.0
    q = mu - lam * (log(s1) + log(s2))
    return mu - q / (s1 * s1), mu - q / (s2 * s2)


@njit(cache=True)
def _gradient(positions, triangles, areas, shapes, lame):
    out = np.zeros_like(positions)
    f = np.empty((3, 2))
    for e in range(len(triangles)):
        _deformation(positions, triangles[e], shapes[e], f)
        s1, s2, vx, vy = _principal(f)
        p1, p2 = _tension_over_stretch(s1, s2, lame[e, 0], lame[e, 1])
        if p1 == 0.0 and p2 == 0.0:
            continue
        # dW/dF = F (p1 v1 v1' + p2 v2 v2')
        xx, xy, yy = p1 * vx * vx + p2 * vy * vy, (p1 - p2) * vx * vy, p1 * vy * vy + p2 * vx * vx
        for i in range(3):
            px = areas[e] * (f[i, 0] * xx + f[i, 1] * xy)
            py = areas[e] * (f[i, 0] * xy + f[i, 1] * yy)
            for k in range(3):
                out[triangles[e, k], i] += px * shapes[e, k, 0] + py * shapes[e, k, 1]
    return out


@njit(cache=True)
def _hessians(positions, triangles, areas, shapes, lame):
    out = np.zeros((len(triangles), 9, 9))
    f = np.empty((3, 2))
    for e in range(len(triangles)):
        _deformation(positions, triangles[e], shapes[e], f)
        _element_hessian(f, areas[e], shapes[e], lame[e, 0], lame[e, 1], out[e])
    return out


@njit(cache=True)
def _element_hessian(f, area, shape, lam, mu, out):
    s1, s2, vx, vy = _principal(f)
    state = _state(s1, s2, lam, mu)
    if state == SLACK:
        return
    if state == WRINKLED:
        w2 = _natural_width_squared(log(s1), lam, mu)
        q = mu * w2
        w11 = mu + (q + lam) / (s1 * s1)
        w12_squared_over_w22 = lam * lam / (s1 * s1 * (mu * w2 + q + lam))
        c1, c12, c2 = w11 - w12_squared_over_w22, 0.0, 0.0
        tension = mu * (s1 - w2 / s1)
        turn, shear = tension / (s1 + s2), tension / (s1 - s2)
        tilt1, tilt2 = tension / s1, 0.0
    else:
        j = s1 * s2
        q = mu - lam * (log(s1) + log(s2))
        c1, c12, c2 = mu + (q + lam) / (s1 * s1), lam / j, mu + (q + lam) / (s2 * s2)
        turn, shear = mu - q / j, mu + q / j
        tilt1, tilt2 = mu - q / (s1 * s1), mu - q / (s2 * s2)

    u1 = np.empty(3)
    u2 = np.empty(3)
    for i in range(3):
        u1[i] = (f[i, 0] * vx + f[i, 1] * vy) / s1
        u2[i] = f[i, 1] * vx - f[i, 0] * vy
    _orthonormal(u1, u2)
    u3 = np.array([u1[1] * u2[2] - u1[2] * u2[1], u1[2] * u2[0] - u1[0] * u2[2], u1[0] * u2[1] - u1[1] * u2[0]])

    # In the frames (u, v): dF = sum g_ij u_i v_j'. Corner k moves g_ij by (u_i . dx_k) (v_j . shape_k).
    along = np.empty((3, 2))
    for k in range(3):
        along[k, 0] = shape[k, 0] * vx + shape[k, 1] * vy
        along[k, 1] = shape[k, 1] * vx - shape[k, 0] * vy
    same, crossed = 0.5 * (turn + shear), 0.5 * (shear - turn)
    for k in range(3):
        for m in range(k + 1):
            a1, a2, b1, b2 = along[k, 0], along[k, 1], along[m, 0], along[m, 1]
            g11 = area * (c1 * a1 * b1 + same * a2 * b2)  # u1, u1
            g22 = area * (c2 * a2 * b2 + same * a1 * b1)  # u2, u2
            g12 = area * (c12 * a1 * b2 + crossed * a2 * b1)  # u1 of k, u2 of m
            g21 = area * (c12 * a2 * b1 + crossed * a1 * b2)
            g33 = area * (tilt1 * a1 * b1 + tilt2 * a2 * b2)
            for i in range(3):
                for n in range(3):
                    out[3 * m + n, 3 * k + i] = out[3 * k + i, 3 * m + n] = (
                        g11 * u1[i] * u1[n]
                        + g22 * u2[i] * u2[n]
                        + g12 * u1[i] * u2[n]
                        + g21 * u2[i] * u1[n]
                        + g33 * u3[i] * u3[n]
                    )


@njit(cache=True)
def _orthonormal(u1, u2):
    """Make ``u2`` a unit vector across ``u1``: any one will do where the triangle has collapsed to a line."""
    dot = u1[0] * u2[0] + u1[1] * u2[1] + u1[2] * u2[2]
    length = 0.0
    size = sqrt(u2[0] * u2[0] + u2[1] * u2[1] + u2[2] * u2[2])
    for i in range(3):
        u2[i] -= dot * u1[i]
        length += u2[i] * u2[i]
    length = sqrt(length)
    if length <= 1e-8 * size or length <= 1e-150:
        smallest = 0
        for i in range(1, 3):
            if abs(u1[i]) < abs(u1[smallest]):
                smallest = i
        length = 0.0
        for i in range(3):
            u2[i] = (1.0 if i == smallest else 0.0) - u1[smallest] * u1[i]
            length += u2[i] * u2[i]
        length = sqrt(length)
    for i in range(3):
        u2[i] /= length
