"""An independent judge of the 2D bench: scikit-fem, quadratic triangles, and the relaxed membrane written another way.

Nothing here comes from ``haptics.garments``. The taut sheet is the textbook neo-Hookean solid in F and its inverse, without
principal stretches. Wrinkled cloth depends on the larger singular value of F only, which for a 2 x 2 matrix is Q + R with

    Q = |(F11 + F22, F21 - F12)| / 2,    R = |(F11 - F22, F21 + F12)| / 2,

two norms whose second derivatives are known. The natural width comes from Lambert's W. The meshes follow the designs in ways of
their own: a grid bent along a strip, squares cut by both diagonals for an X.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import splu
from scipy.special import lambertw
from skfem import Basis, BilinearForm, ElementTriP2, ElementVector, LinearForm, MeshTri

Array = NDArray[np.float64]
CLOTH = (0.5e6, 0.27e-3)
REINFORCED = (5.7e6, 0.35e-3)
NU = 0.33
SIDE_M = 0.1
_LINEAR = np.array(  # the vectors of Q and of R as linear functions of (F11, F12, F21, F22)
    [[[0.5, 0, 0, 0.5], [0, -0.5, 0.5, 0]], [[0.5, 0, 0, -0.5], [0, 0.5, 0.5, 0]]]
)


def lame_n_m(material: tuple[float, float], lame: str = "plane", nu: float = NU) -> tuple[float, float]:
    """(lambda, mu) times the thickness of (E, thickness)."""
    young, thickness = material
    lam = young * nu / ((1 - nu**2) if lame == "plane" else (1 + nu) * (1 - 2 * nu))
    return lam * thickness, young / (2 * (1 + nu)) * thickness


def width_squared(s1: Array, lam: Array, mu: Array) -> Array:
    """w^2 of mu (w^2 - 1) + lambda/2 log(s1^2 w^2) = 0."""
    ratio = 2 * mu / lam
    return lambertw(ratio * np.exp(ratio) / s1**2).real / ratio


def density(f: Array, lam: Array, mu: Array) -> tuple[Array, Array, Array]:
    """W, dW/dF and d2W/dF2 at F: ``(n, 2, 2)`` gives ``(n,)``, ``(n, 4)`` and ``(n, 4, 4)``, F row by row."""
    flat = f.reshape(-1, 4)
    norms, firsts, seconds = [], [], []
    for linear in _LINEAR:
        vector = flat @ linear.T
        norm = np.maximum(np.linalg.norm(vector, axis=1), 1e-300)
        unit = vector / norm[:, None]
        norms.append(norm)
        firsts.append(unit @ linear)
        across = (np.eye(2) - unit[:, :, None] * unit[:, None, :]) / norm[:, None, None]
        seconds.append(linear.T @ across @ linear)
    s1, s2 = norms[0] + norms[1], np.abs(norms[0] - norms[1])
    w = np.zeros(len(flat))
    p = np.zeros((len(flat), 4))
    tangent = np.zeros((len(flat), 4, 4))

    slack = s1 <= 1
    y = width_squared(np.maximum(s1, 1.0), lam, mu)
    wrinkled = ~slack & (s2**2 < y)
    taut = ~slack & ~wrinkled

    k = wrinkled
    s, m, la, yk = s1[k], mu[k], lam[k], y[k]
    log_j = np.log(s) + 0.5 * np.log(yk)
    w[k] = m / 2 * (s**2 + yk - 2) - m * log_j + la / 2 * log_j**2
    slope = m * (s - yk / s)
    bend = m * (1 + yk / s**2) + m * la / (s**2 * (m + la / (2 * yk)))
    n = (firsts[0] + firsts[1])[k]
    p[k] = slope[:, None] * n
    tangent[k] = bend[:, None, None] * n[:, :, None] * n[:, None, :] + slope[:, None, None] * (seconds[0] + seconds[1])[k]

    k = taut
    fk, m, la = f[k], mu[k], lam[k]
    log_j = np.log(np.abs(np.linalg.det(fk)))
    inverse_t = np.swapaxes(np.linalg.inv(fk), 1, 2)
    w[k] = m / 2 * ((fk**2).sum(axis=(1, 2)) - 2) - m * log_j + la / 2 * log_j**2
    q = m - la * log_j
    p[k] = (m[:, None, None] * fk - q[:, None, None] * inverse_t).reshape(-1, 4)
    g = inverse_t.reshape(-1, 4)
    # d(F^-T) = - F^-T dF^T F^-T
    turned = np.einsum("nil,nkj->nijkl", inverse_t, inverse_t).reshape(-1, 4, 4)
    tangent[k] = m[:, None, None] * np.eye(4) + la[:, None, None] * g[:, :, None] * g[:, None, :] + q[:, None, None] * turned
    return w, p, tangent


@dataclass(frozen=True)
class Judged:
    """Force at the pulled clamp, energy, and the force left over inside."""

    force_n: float
    energy_j: float
    residual_n: float


def judge_patch(
    mesh: MeshTri, reinforced_at: Callable[[Array, Array], NDArray[np.bool_]], strain: float = 0.1, lame: str = "plane"
) -> Judged:
    """The square patch, held at x = 0, pulled at x = side; both ends may not narrow.

    :param mesh: of the square; its triangles are of one material each.
    :param reinforced_at: whether cloth at (x, y) is reinforced.
    """
    basis = Basis(mesh, ElementVector(ElementTriP2()), intorder=4)
    place = np.asarray(basis.global_coordinates())
    of_triangle = reinforced_at(place[0], place[1])
    assert not np.ptp(of_triangle.astype(int), axis=1).any(), "a triangle of two materials"
    stiff = of_triangle.ravel()
    both = [lame_n_m(CLOTH, lame), lame_n_m(REINFORCED, lame)]
    lam, mu = (np.where(stiff, both[1][i], both[0][i]) for i in (0, 1))
    shape = place[0].shape

    held = basis.get_dofs(lambda p: p[0] < 1e-9).all()
    pulled = basis.get_dofs(lambda p: p[0] > SIDE_M - 1e-9)
    pulled_x = pulled.all("u^1")
    inner = np.setdiff1d(np.arange(basis.N), np.concatenate([held, pulled.all()]))

    @LinearForm
    def force(v, w):
        return sum(w[f"p{i}{j}"] * v.grad[i, j] for i in range(2) for j in range(2))

    @BilinearForm
    def stiffness(u, v, w):
        return sum(
            w[f"t{i}{j}{k}{m}"] * u.grad[k, m] * v.grad[i, j]
            for i in range(2)
            for j in range(2)
            for k in range(2)
            for m in range(2)
        )

    def state(u: Array) -> tuple[float, dict[str, Array], Array]:
        gradient = np.asarray(basis.interpolate(u).grad)
        f = np.moveaxis(gradient.reshape(2, 2, -1), 2, 0) + np.eye(2)
        w, p, tangent = density(f, lam, mu)
        fields = {f"p{i}{j}": p[:, 2 * i + j].reshape(shape) for i in range(2) for j in range(2)}
        return float((w.reshape(shape) * basis.dx).sum()), fields, tangent

    def loads(fields: dict[str, Array]) -> Array:
        return force.assemble(basis, **fields)

    u = np.zeros(basis.N)
    x_dofs = basis.get_dofs(elements=np.arange(mesh.nelements)).all("u^1")
    u[x_dofs] = strain * basis.doflocs[0, x_dofs]
    energy, fields, tangent = state(u)
    residual = loads(fields)
    for _ in range(60):
        if np.linalg.norm(residual[inner]) < 1e-10:
            break
        matrix = stiffness.assemble(
            basis,
            **{
                f"t{i}{j}{k}{m}": tangent[:, 2 * i + j, 2 * k + m].reshape(shape)
                for i in range(2)
                for j in range(2)
                for k in range(2)
                for m in range(2)
            },
        ).tocsc()[inner][:, inner]
        matrix.setdiag(matrix.diagonal() + 1e-9 * mu.max())  # slack cloth has no stiffness
        step = np.zeros(basis.N)
        step[inner] = -splu(matrix).solve(residual[inner])
        scale = 1.0
        while True:
            trial = state(u + scale * step)
            trial_residual = loads(trial[1])
            lower = trial[0] <= energy + 1e-4 * scale * (residual[inner] @ step[inner])
            if lower or np.linalg.norm(trial_residual[inner]) < 0.5 * np.linalg.norm(residual[inner]) or scale < 1e-6:
                break
            scale *= 0.5
        u, (energy, fields, tangent), residual = u + scale * step, trial, trial_residual
    return Judged(float(residual[pulled_x].sum()), energy, float(np.linalg.norm(residual[inner])))


def even_mesh(cells: int) -> MeshTri:
    """Squares of two triangles."""
    x = np.linspace(0, SIDE_M, cells + 1)
    return MeshTri.init_tensor(x, x)


def strip(
    coverage: float, angle_deg: float = 0.0
) -> tuple[Callable[[int], MeshTri], Callable[[Array, Array], NDArray[np.bool_]]]:
    """A centred strip from clamp to clamp, or from side to side, at an angle from the pull.

    Its share of the square is its height along y (x, where it is steep) over the side, so its edges may not reach the other two
    sides. In the mesh, rows (columns) are bent along it.
    """
    steep = abs(angle_deg) > 45
    slope = np.tan(np.deg2rad(90 - angle_deg if steep else angle_deg))
    half = 0.5 * SIDE_M
    assert abs(slope) + coverage < 1, "the strip reaches another side"

    def middle(along: Array) -> Array:
        return half + slope * (along - half)

    def mesh(cells: int) -> MeshTri:
        grid = MeshTri.init_tensor(np.linspace(0, SIDE_M, cells + 1), np.linspace(0, 3, 3 * (cells // 2) + 1))
        along, level = grid.p
        low, high = middle(along) - coverage * half, middle(along) + coverage * half
        across = np.where(
            level <= 1, level * low, np.where(level <= 2, low + (level - 1) * (high - low), high + (level - 2) * (SIDE_M - high))
        )
        return MeshTri(np.stack([across, along] if steep else [along, across]), grid.t)

    def reinforced_at(x: Array, y: Array) -> NDArray[np.bool_]:
        along, across = (y, x) if steep else (x, y)
        return np.abs(across - middle(along)) <= coverage * half

    return mesh, reinforced_at


def x_design(part: int) -> tuple[float, Callable[[int], MeshTri], Callable[[Array, Array], NDArray[np.bool_]]]:
    """Bands along both diagonals, |x - y| and |x + y - side| <= side / part, with their share of the square.

    Its complement is four triangles, each of the height (side - 2 side / part) / 2.
    """
    reach = SIDE_M / part

    def mesh(cells: int) -> MeshTri:
        assert cells % part == 0
        x = np.linspace(0, SIDE_M, cells + 1)
        corner = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
        a, b, c, d = (corner[i : i + cells, j : j + cells].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
        centre = (cells + 1) ** 2 + np.arange(cells**2)
        points = np.stack(np.meshgrid(x, x, indexing="ij")).reshape(2, -1)
        middles = points[:, a] + 0.5 * SIDE_M / cells
        triangles = [np.stack([p, q, centre]) for p, q in ((a, b), (b, c), (c, d), (d, a))]
        return MeshTri(np.concatenate([points, middles], axis=1), np.concatenate(triangles, axis=1))

    def reinforced_at(x: Array, y: Array) -> NDArray[np.bool_]:
        return (np.abs(x - y) <= reach) | (np.abs(x + y - SIDE_M) <= reach)

    return 1 - (1 - 2 / part) ** 2, mesh, reinforced_at
