"""Makes the analytic body's mesh, which the package ships: python tools/make_capsule_body.py

Marching cubes on the mannequin's distance, short edges collapsed to about ``EDGE_M``, then rounds of edge flips towards
Delaunay triangles, tangential smoothing and projection onto the zero level.
"""

from __future__ import annotations

from pathlib import Path

import igl
import numpy as np

from haptics.garments.bodies import mannequin
from haptics.garments.mesh import Floats, Ints, SurfaceMesh, checked_mesh

OUT = Path(__file__).parents[1] / "haptics" / "garments" / "bodies" / "capsule.npz"
EDGE_M = 0.0196
GRID_M = 0.009
ROUNDS = 40


def polygonised() -> tuple[Floats, Ints]:
    """The mannequin's zero level by marching cubes.

    :return: vertices, m, ``(n, 3)``; triangles, ``(n, 3)``.
    """
    low, high = np.array([-0.75, -0.26, -0.05]), np.array([0.75, 0.22, 1.85])
    counts = np.ceil((high - low) / GRID_M).astype(int)
    axes = [low[i] + GRID_M * np.arange(counts[i]) for i in range(3)]
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")  # x runs fastest
    grid = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    values = np.concatenate([mannequin.distance_m(part) for part in np.array_split(grid, 20)])
    nx, ny, nz = (int(count) for count in counts)
    vertices, triangles, _ = igl.marching_cubes(values, grid, nx, ny, nz, 0.0)
    return np.asarray(vertices, dtype=np.float64), np.asarray(triangles, dtype=np.int64)


def coarsened(vertices: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Short edges collapsed until edges are about ``EDGE_M`` long.

    :param vertices: the mesh, m.
    :param triangles: likewise, with ``vertices``.
    :return: the coarser mesh, m.
    """
    area = SurfaceMesh(vertices, triangles).areas_m2.sum()
    target = int(area / (np.sqrt(3) / 4 * EDGE_M**2))
    fewer, corners, *_ = igl.decimate(np.asfortranarray(vertices), np.asfortranarray(triangles.astype(np.int32)), target)
    return np.ascontiguousarray(fewer), np.ascontiguousarray(corners, dtype=np.int64)


def flipped_to_delaunay(vertices: Floats, triangles: Ints) -> Ints:
    """Flips each edge whose opposite angles sum to more than a half turn, once round.

    :param vertices: the mesh, m.
    :param triangles: likewise, with ``vertices``.
    :return: the triangles after it.
    """
    corners = [tuple(int(i) for i in triangle) for triangle in triangles]
    of_edge = {(t[i], t[(i + 1) % 3]): n for n, t in enumerate(corners) for i in range(3)}
    for a, b in sorted(edge for edge in of_edge if edge[0] < edge[1]):
        if (a, b) not in of_edge or (b, a) not in of_edge:
            continue  # flipped away
        first, second = of_edge[a, b], of_edge[b, a]
        c = next(i for i in corners[first] if i not in (a, b))
        d = next(i for i in corners[second] if i not in (a, b))
        angles = _angle(vertices[c], vertices[a], vertices[b]) + _angle(vertices[d], vertices[a], vertices[b])
        if angles <= np.pi + 1e-6 or (c, d) in of_edge or (d, c) in of_edge:
            continue
        for triangle in (first, second):
            for i in range(3):
                del of_edge[corners[triangle][i], corners[triangle][(i + 1) % 3]]
        corners[first], corners[second] = (c, a, d), (d, b, c)
        for triangle in (first, second):
            for i in range(3):
                of_edge[corners[triangle][i], corners[triangle][(i + 1) % 3]] = triangle
    return np.array(corners)


def _angle(apex: Floats, a: Floats, b: Floats) -> float:
    u, v = a - apex, b - apex
    return float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))


def smoothed(vertices: Floats, triangles: Ints) -> Floats:
    """Each vertex half way towards the mean of its neighbours, in the tangent plane.

    :param vertices: the mesh, m.
    :param triangles: likewise, with ``vertices``.
    :return: the vertices after it, m.
    """
    edges = SurfaceMesh(vertices, triangles).edges
    total, count = np.zeros_like(vertices), np.bincount(edges.ravel(), minlength=len(vertices))
    np.add.at(total, edges[:, 0], vertices[edges[:, 1]])
    np.add.at(total, edges[:, 1], vertices[edges[:, 0]])
    normal = mannequin.gradient(vertices)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    step = 0.5 * (total / count[:, None] - vertices)
    return vertices + step - np.sum(step * normal, axis=1, keepdims=True) * normal


def projected(vertices: Floats) -> Floats:
    """Vertices moved along the gradient onto the mannequin's zero level.

    :param vertices: m, ``(n, 3)``.
    :return: m, ``(n, 3)``.
    """
    for _ in range(4):
        slope = mannequin.gradient(vertices)
        vertices = vertices - mannequin.distance_m(vertices)[:, None] * slope / np.sum(slope * slope, axis=1, keepdims=True)
    return vertices


def main() -> None:
    """Make the mesh and write it where the package ships it."""
    vertices, triangles = coarsened(*polygonised())
    for _ in range(ROUNDS):
        triangles = flipped_to_delaunay(vertices, triangles)
        vertices = projected(smoothed(vertices, triangles))
    single = projected(vertices).astype(np.float32)
    mesh = checked_mesh(single.astype(np.float64), triangles, "capsule body", closed=True)
    np.savez_compressed(OUT, vertices_m=single, triangles=triangles.astype(np.uint16))
    lengths = np.linalg.norm(np.diff(mesh.vertices_m[mesh.edges], axis=1)[:, 0], axis=1)
    print(f"{OUT}: {len(single)} vertices, {len(triangles)} triangles, edges {lengths.min():.4f} to {lengths.max():.4f} m")


if __name__ == "__main__":
    main()
