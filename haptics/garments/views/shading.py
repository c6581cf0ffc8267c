"""Meshes as a shaded picture: parallel rays, one depth a pixel, light from beside the viewer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from haptics.garments.mesh import Floats, Ints, SurfaceMesh

Pixels = NDArray[np.float64]
SAMPLES = 3
"""Rays along a pixel's side: edges are smooth."""
DARKEST = 0.55
"""Share of a colour left where the surface turns away from the light: a colour bar can still be read."""


@dataclass(frozen=True, eq=False)
class View:
    """The direction and frame of a picture.

    :param azimuth_deg: degrees from straight in front of a body that faces -y, positive towards its left.
    :param elevation_deg: degrees above the horizon.
    :param centre_m: what is in the middle, m, ``(3,)``.
    :param width_m: of the frame, m.
    :param height_m: of the frame, m.
    """

    azimuth_deg: float
    elevation_deg: float
    centre_m: Floats
    width_m: float
    height_m: float

    @property
    def axes(self) -> Floats:
        """Unit vectors to the right, up, and to the viewer, ``(3, 3)``, one a row."""
        azimuth, elevation = np.radians([self.azimuth_deg, self.elevation_deg])
        to_viewer = np.array([np.sin(azimuth) * np.cos(elevation), -np.cos(azimuth) * np.cos(elevation), np.sin(elevation)])
        right = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        return np.stack([right, np.cross(to_viewer, right), to_viewer])


@dataclass(frozen=True, eq=False)
class Painted:
    """A mesh and its colours.

    :param mesh: the surface.
    :param colours: red, green, blue, 0 to 1: ``(triangles, 3)``.
    :param lift_m: drawn as if it were this much nearer to the viewer, m: cloth lies on skin, in parts a little below it.
    """

    mesh: SurfaceMesh
    colours: Floats
    lift_m: float = 0.0


def framed(points_m: Floats, azimuth_deg: float, elevation_deg: float, margin: float = 0.06) -> View:
    """The view from a direction that just holds all points, with a margin.

    :param points_m: m, ``(points, 3)``.
    :param azimuth_deg: as in ``View``.
    :param elevation_deg: as in ``View``.
    :param margin: on each side, as a part of the points' extent, no unit.
    :return: the view.
    """
    axes = View(azimuth_deg, elevation_deg, np.zeros(3), 1.0, 1.0).axes
    seen = points_m @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    width, height = (1 + 2 * margin) * (high - low)[:2]
    return View(azimuth_deg, elevation_deg, (low + high) / 2 @ axes, float(width), float(height))


def shaded(things: Sequence[Painted], view: View, pixels_per_m: float) -> Pixels:
    """The meshes as a picture.

    :param things: what is drawn; the nearest is seen.
    :param view: direction and frame.
    :param pixels_per_m: resolution, 1/m.
    :return: red, green, blue and opacity, 0 to 1, ``(rows, columns, 4)``.
    """
    rows, columns = (max(1, round(size * pixels_per_m)) for size in (view.height_m, view.width_m))
    fine = SAMPLES * pixels_per_m
    picture = np.zeros((SAMPLES * rows, SAMPLES * columns, 4))
    depth = np.full(picture.shape[:2], -np.inf)
    for thing in things:
        seen = (thing.mesh.vertices_m - view.centre_m) @ view.axes.T
        flat = np.stack([columns * SAMPLES / 2 + fine * seen[:, 0], rows * SAMPLES / 2 - fine * seen[:, 1]], axis=1)
        light = np.array([-0.35, 0.45, 0.82])
        lit = np.abs(thing.mesh.vertex_normals @ view.axes.T @ light)
        _paint(picture, depth, flat, seen[:, 2] + thing.lift_m, lit, thing.mesh.triangles, thing.colours)
    rays = np.sum([picture[i::SAMPLES, j::SAMPLES] for i in range(SAMPLES) for j in range(SAMPLES)], axis=0)
    colour = rays[..., :3] / np.maximum(rays[..., 3:], 1.0)
    return np.concatenate([np.clip(colour, 0.0, 1.0), rays[..., 3:] / SAMPLES**2], axis=2)


@njit(cache=True)
def _paint(picture: Pixels, depth: Floats, flat: Floats, near: Floats, lit: Floats, triangles: Ints, colours: Floats) -> None:
    """Each triangle's pixels where it is nearer than what is there, in its colour times the light at its corners."""
    rows, columns = depth.shape
    for t in range(len(triangles)):
        a, b, c = triangles[t]
        area = (flat[b, 0] - flat[a, 0]) * (flat[c, 1] - flat[a, 1]) - (flat[c, 0] - flat[a, 0]) * (flat[b, 1] - flat[a, 1])
        if area == 0.0:
            continue
        left = max(0, int(np.ceil(min(flat[a, 0], flat[b, 0], flat[c, 0]) - 0.5)))
        right = min(columns - 1, int(np.floor(max(flat[a, 0], flat[b, 0], flat[c, 0]) - 0.5)))
        top = max(0, int(np.ceil(min(flat[a, 1], flat[b, 1], flat[c, 1]) - 0.5)))
        bottom = min(rows - 1, int(np.floor(max(flat[a, 1], flat[b, 1], flat[c, 1]) - 0.5)))
        for row in range(top, bottom + 1):
            y = row + 0.5
            for column in range(left, right + 1):
                x = column + 0.5
                u = ((x - flat[a, 0]) * (flat[c, 1] - flat[a, 1]) - (flat[c, 0] - flat[a, 0]) * (y - flat[a, 1])) / area
                v = ((flat[b, 0] - flat[a, 0]) * (y - flat[a, 1]) - (x - flat[a, 0]) * (flat[b, 1] - flat[a, 1])) / area
                if u < 0.0 or v < 0.0 or u + v > 1.0:
                    continue
                z = (1 - u - v) * near[a] + u * near[b] + v * near[c]
                if z <= depth[row, column]:
                    continue
                depth[row, column] = z
                shade = DARKEST + (1 - DARKEST) * ((1 - u - v) * lit[a] + u * lit[b] + v * lit[c])
                for k in range(3):
                    picture[row, column, k] = colours[t, k] * shade
                picture[row, column, 3] = 1.0
