"""Designs drawn elsewhere, as masks of triangles: a picture, a surface modelled over the garment, a list of triangles."""

from __future__ import annotations

import os
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from haptics.errors import InputError
from haptics.extras import install
from haptics.garments.cut.coarsening import libigl
from haptics.garments.design.geodesic import SurfaceGraph, boundary_loops
from haptics.garments.design.rating import first_by_area
from haptics.garments.mesh import Bools, Floats, SurfaceMesh
from haptics.units import in_range, one_of

MASKS = (".png", ".obj", ".ply", ".stl", ".txt", ".npz")
"""Endings of the files that a mask can come in."""
NEAR_M = 0.005
"""A triangle this near to a drawn surface is reinforced."""
FRONT = np.array([0.0, -1.0, 0.0])
"""Where the body faces."""


def read_mask(
    path: str | os.PathLike[str],
    rest: SurfaceMesh,
    near_m: float = NEAR_M,
    units: str | None = None,
    up: str | None = None,
    note: Callable[[str], None] | None = None,
) -> Bools:
    """The mask in a file, by its ending.

    ``mask_from_image`` reads .png; ``mask_from_surface`` .obj, .ply and .stl; ``mask_from_list`` .txt and .npz.

    :param path: the file; its ending is one of ``MASKS``.
    :param rest: the garment at rest on the straight body.
    :param near_m: see ``mask_from_surface``.
    :param units: of a surface, as ``read_mesh`` takes them.
    :param up: of a surface, as ``read_mesh`` takes it.
    :param note: of a surface, as ``read_mesh`` takes it.
    :return: reinforced triangles, ``(triangles,)``.
    :raises InputError: another ending, a mask that reinforces nothing, or what those raise.
    """
    path = Path(path)
    ending = one_of(f"ending of {path.name}", path.suffix.lower(), MASKS)
    if ending == ".png":
        mask = mask_from_image(path, rest)
    elif ending in (".txt", ".npz"):
        mask = mask_from_list(path, len(rest.triangles))
    else:
        mask = mask_from_surface(path, rest, near_m, units, up, note)
    if not mask.any():
        raise InputError(f"{path} reinforces nothing; expected at least one triangle")
    return mask


def mask_from_image(path: str | os.PathLike[str], rest: SurfaceMesh) -> Bools:
    """A greyscale picture wrapped around the garment at rest: dark (below half) is reinforced.

    The garment's axis joins the centres of the two openings that are farthest apart. Columns are the angle around it: the garment
    is slit at the back and laid out seen from outside, so that the middle is the front and the right side the body's left. Rows
    are the length along the axis, the higher end at the top.

    :param path: the picture.
    :param rest: the garment at rest on the straight body.
    :return: reinforced triangles, ``(triangles,)``.
    :raises InputError: no such picture, none that can be read, fewer than two openings, or matplotlib is not installed.
    """
    ink = _ink(Path(path))
    around, along = _wrapped(rest)
    rows = np.minimum((along * ink.shape[0]).astype(int), ink.shape[0] - 1)
    columns = np.minimum((around * ink.shape[1]).astype(int), ink.shape[1] - 1)
    return ink[rows, columns]


def mask_from_surface(
    path: str | os.PathLike[str],
    rest: SurfaceMesh,
    near_m: float = NEAR_M,
    units: str | None = None,
    up: str | None = None,
    note: Callable[[str], None] | None = None,
) -> Bools:
    """The triangles whose centre is nearer than ``near_m`` to a drawn surface.

    :param path: a mesh, drawn over the garment at rest on the straight body.
    :param rest: the garment there.
    :param near_m: distance, m, 1e-5 to 0.1.
    :param units: as ``read_mesh`` takes them.
    :param up: as ``read_mesh`` takes it.
    :param note: as ``read_mesh`` takes it.
    :return: reinforced triangles, ``(triangles,)``.
    :raises InputError: a mesh that cannot be used, no triangle near it, or libigl is not installed.
    """
    from haptics.garments.mesh_files import read_mesh

    in_range("near_m", near_m, 1e-5, 0.1, "m")
    surface = read_mesh(Path(path), units=units, up=up, around_m=rest.vertices_m, note=note)
    squared: Any = libigl().point_mesh_squared_distance(rest.centres_m, surface.vertices_m, surface.triangles)[0]
    mask = squared <= near_m**2
    if not mask.any():
        raise InputError(
            f"{path}: its nearest point is {np.sqrt(squared.min()):.3g} m from the garment; expected one within {near_m:g} m"
        )
    return mask


def mask_from_list(path: str | os.PathLike[str], triangles: int) -> Bools:
    """A list of reinforced triangles: text with their numbers from 0, or .npz with ``triangles`` or ``design`` (bool).

    In text # begins a comment.

    :param path: the file.
    :param triangles: how many the garment has.
    :return: reinforced triangles, ``(triangles,)``.
    :raises InputError: a file that cannot be read, or does not fit the garment.
    """
    path = Path(path)
    try:
        if path.suffix.lower() == ".npz":
            with np.load(path, allow_pickle=False) as data:
                if "design" in data:
                    design = data["design"]
                    if design.shape != (triangles,) or design.dtype != np.bool_:
                        raise InputError(
                            f"{path}: design is {design.dtype} of shape {design.shape}; expected bool of shape ({triangles},)"
                        )
                    return design
                numbers = data["triangles"]
        else:
            with warnings.catch_warnings(action="ignore"):  # of an empty file: an empty list, which is refused as such
                numbers = np.loadtxt(path, dtype=np.int64, comments="#", ndmin=1)
    except InputError:
        raise
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not a list of triangles: {error}") from error
    if numbers.ndim != 1 or not np.issubdtype(numbers.dtype, np.integer):
        raise InputError(f"{path}: triangles are {numbers.dtype} of shape {numbers.shape}; expected one row of whole numbers")
    bad = numbers[(numbers < 0) | (numbers >= triangles)]
    if len(bad):
        raise InputError(f"{path}: triangle {bad[0]} does not exist; allowed: 0 to {triangles - 1}")
    mask = np.zeros(triangles, bool)
    mask[numbers] = True
    return mask


def with_coverage(mask: Bools, rest: SurfaceMesh, designable: Bools, coverage: float) -> Bools:
    """The mask grown or trimmed along its border, by distance over the surface, until it has the coverage.

    :param mask: reinforced triangles, ``(triangles,)``.
    :param rest: the garment at rest.
    :param designable: triangles that may be reinforced, ``(triangles,)``.
    :param coverage: reinforced over designable area, 0.01 to 1; met to half a triangle.
    :return: reinforced triangles, ``(triangles,)``.
    :raises InputError: a coverage out of range, or a mask without a border: all or nothing.
    """
    in_range("coverage", coverage, 0.01, 1.0)
    edges, vertices = rest.edges, len(rest.vertices_m)
    sides = np.sort(np.stack([rest.triangles, np.roll(rest.triangles, -1, axis=1)], axis=2), axis=2) @ [vertices, 1]
    edge = np.searchsorted(edges @ [vertices, 1], sides)
    reinforced = np.bincount(edge.ravel(), np.repeat(mask, 3), minlength=len(edges))
    border = edges[(reinforced == 1) & (np.bincount(edge.ravel(), minlength=len(edges)) == 2)]
    if not len(border):
        what = "everything" if mask.all() else "nothing"
        raise InputError(f"mask reinforces {what}, so that it has no border to move; expected some triangles, not all")
    graph = SurfaceGraph(rest)
    away = graph.to_centres(graph.paths_from(border.ravel()).lengths_m)
    away = np.where(mask, -away, away)
    ranked = np.lexsort((np.arange(len(away)), away))
    ranked = ranked[designable[ranked]]
    out = np.zeros(len(mask), bool)
    out[first_by_area(ranked, rest.areas_m2, coverage * float(rest.areas_m2[designable].sum()))] = True
    return out


def _ink(path: Path) -> Bools:
    try:
        from matplotlib.image import imread
    except ImportError as error:
        raise InputError(f"pictures need matplotlib ({error}): {install('report')}") from error
    try:
        pixels = np.asarray(imread(path), dtype=float)
    except (OSError, SyntaxError, ValueError) as error:
        raise InputError(f"{path}: not a readable picture: {error}") from error
    if pixels.ndim == 3:
        colours = pixels[:, :, :3] if pixels.shape[2] >= 3 else pixels[:, :, :1]
        opaque = pixels[:, :, -1] if pixels.shape[2] in (2, 4) else 1.0
        pixels = 1 - opaque * (1 - colours.mean(axis=2))  # what is transparent is white paper
    return pixels < 0.5


def _wrapped(rest: SurfaceMesh) -> tuple[Floats, Floats]:
    """Angle around the garment and length along it of each triangle's centre, both 0 to 1."""
    loops = boundary_loops(rest)
    if len(loops) < 2:
        raise InputError(f"{rest.name} has {len(loops)} openings; a picture needs at least 2 to be wrapped around it")
    middles = np.array([rest.vertices_m[loop].mean(axis=0) for loop in loops])
    apart = np.linalg.norm(middles[:, None] - middles[None], axis=2)
    a, b = np.unravel_index(np.argmax(apart), apart.shape)
    low, high = (a, b) if middles[a, 2] <= middles[b, 2] else (b, a)
    axis = (middles[high] - middles[low]) / apart[a, b]
    front = FRONT - axis * (FRONT @ axis)
    if np.linalg.norm(front) < 1e-6:
        raise InputError(f"{rest.name}: its axis points to the front, so that a picture cannot be wrapped around it")
    front /= np.linalg.norm(front)
    left = np.cross(axis, front)
    centres = rest.centres_m - middles[low]
    along = centres @ axis
    along = (along - along.min()) / np.ptp(along)
    return np.arctan2(centres @ left, centres @ front) / (2 * np.pi) + 0.5, 1 - along
