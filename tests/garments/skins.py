"""Measures of a posed skin that tests share."""

from __future__ import annotations

import numpy as np

from haptics.garments.mesh import Bools, Floats, Ints, SurfaceMesh


def volume_m3(vertices_m: Floats, triangles: Ints) -> float:
    """Volume within a closed surface, by the divergence theorem."""
    a, b, c = (vertices_m[triangles[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def folds_deg(vertices_m: Floats, triangles: Ints) -> Floats:
    """Angle between the normals of each two triangles that share an edge; a flipped triangle makes 180 degrees."""
    cross = SurfaceMesh(vertices_m, triangles).cross_m2
    normals = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    neighbours: dict[tuple[int, int], int] = {}
    pairs = []
    for number, corners in enumerate(triangles.tolist()):
        for i in range(3):
            edge = (corners[i], corners[(i + 1) % 3])
            if edge[::-1] in neighbours:
                pairs.append((neighbours[edge[::-1]], number))
            neighbours[edge] = number
    one, other = np.array(pairs).T
    return np.degrees(np.arccos(np.clip(np.sum(normals[one] * normals[other], axis=1), -1, 1)))


def triangles_within(vertices: Bools, triangles: Ints) -> Ints:
    """Triangles all of whose corners are among the vertices."""
    return triangles[vertices[triangles].all(axis=1)]


def rotation_between(before_m: Floats, after_m: Floats) -> Floats:
    """The rotation vector that takes one cloud of points nearest to another, by Kabsch's method."""
    from scipy.spatial.transform import Rotation

    return Rotation.align_vectors(after_m - after_m.mean(axis=0), before_m - before_m.mean(axis=0))[0].as_rotvec()
