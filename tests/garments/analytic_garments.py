"""Garments whose shapes are known: tubes of any profile, a cap of a sphere, a thing with three openings."""

from functools import cache

import numpy as np

from haptics.garments.mesh import SurfaceMesh


def nothing(mesh: SurfaceMesh):
    return np.zeros(len(mesh.triangles), bool)


def tube(around=36, along=40, radius_m=0.05, top_m=None, length_m=0.4, bulge=0.0) -> SurfaceMesh:
    """About the z axis, rows of triangles staggered; a cone if ``top_m`` differs, a barrel if it bulges."""
    row, column = (index.ravel() for index in np.indices((along + 1, around)))
    height = row / along
    radius = radius_m + ((radius_m if top_m is None else top_m) - radius_m) * height + bulge * np.sin(np.pi * height)
    angle = 2 * np.pi * (column + 0.5 * (row % 2)) / around
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), length_m * height], axis=1)
    triangles = []
    for i in range(along):
        for j in range(around):
            a, b = i * around + j, i * around + (j + 1) % around
            c, d = a + around, b + around
            triangles += [(a, b, c), (b, d, c)] if i % 2 == 0 else [(a, b, d), (a, d, c)]
    return SurfaceMesh(vertices, np.array(triangles), "tube")


def cap(half_angle_deg=40.0, radius_m=0.1, rings=24) -> SurfaceMesh:
    """A cap of a sphere about the z axis: ring i has 6 i vertices."""
    points, starts = [(0.0, 0.0)], [0]
    for ring in range(1, rings + 1):
        starts.append(len(points))
        points += [(ring / rings, 2 * np.pi * k / (6 * ring)) for k in range(6 * ring)]
    triangles = []
    for ring in range(1, rings + 1):
        inner, outer = 6 * (ring - 1), 6 * ring
        for sector in range(6):
            for k in range(ring):
                a, b = sector * ring + k, (sector * ring + k + 1) % outer
                at = [starts[ring] + a, starts[ring] + b]
                below = starts[ring - 1] + ((sector * (ring - 1) + k) % inner if inner else 0)
                triangles.append((below, *at))
                if k + 1 < ring:
                    triangles.append((below, at[1], starts[ring - 1] + (sector * (ring - 1) + k + 1) % inner))
    polar, azimuth = np.deg2rad(half_angle_deg) * np.array(points).T[0], np.array(points).T[1]
    vertices = radius_m * np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1)
    return SurfaceMesh(vertices, np.array(triangles), "cap")


@cache
def three_openings() -> SurfaceMesh:
    """Shorts of sorts: a waist and two legs, the zero level of three blended cylinders, on a grid of 12 mm."""
    import igl

    step, low, high = 0.012, np.array([-0.24, -0.16, -0.25]), np.array([0.24, 0.16, 0.17])
    x, y, z = (np.arange(a, b, step) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).transpose(2, 1, 0, 3).reshape(-1, 3)

    def limb(a, b, radius):
        along = np.subtract(b, a)
        share = np.clip((grid - a) @ along / (along @ along), 0.0, 1.0)
        return np.linalg.norm(grid - a - share[:, None] * along, axis=1) - radius

    limbs = [
        limb((0, 0, 0.0), (0, 0, 0.5), 0.11),
        limb((0.05, 0, 0), (0.13, 0, -0.5), 0.065),
        limb((-0.05, 0, 0), (-0.13, 0, -0.5), 0.065),
    ]
    distance = -0.02 * np.log(sum(np.exp(-limb / 0.02) for limb in limbs))
    vertices, triangles, _ = igl.marching_cubes(distance, grid, len(x), len(y), len(z), 0.0)
    triangles = np.asarray(triangles, np.int64)
    centres = vertices[triangles].mean(axis=1)
    kept = triangles[(centres[:, 2] < 0.14) & (centres[:, 2] > -0.2)]
    used, renumbered = np.unique(kept, return_inverse=True)
    kept = np.asfortranarray(renumbered.reshape(-1, 3).astype(np.int32))
    # Marching cubes leave slivers; the shortest edges are collapsed.
    vertices, triangles, _, _ = igl.decimate(np.asfortranarray(np.asarray(vertices)[used]), kept, 3000)
    return SurfaceMesh(np.ascontiguousarray(vertices), np.ascontiguousarray(triangles, dtype=np.int64), "shorts")
