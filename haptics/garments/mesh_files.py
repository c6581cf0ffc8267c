"""Garments and bodies as mesh files: read, mended and checked; written with the design and the energy for any viewer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from haptics.errors import InputError
from haptics.garments.mesh import SMALLEST_AREA_M2, WORN, Bools, Floats, Ints, SurfaceMesh, checked_mesh
from haptics.meshes import AXES, UNITS, WORDS, best_fit, cleaned, extent_of, in_frame, read_triangles, size_fault
from haptics.recording.output import refuse_existing, replacing
from haptics.units import one_of

NEAR_M = 0.04
"""Most of a garment lies within this distance of points of its body: 3 cm, and half the space between the points."""
LOOSE_M = 0.1
"""The same for a garment that was drawn too loosely, with the right axis up. Assumed."""
LOWEST_COLOUR, HIGHEST_COLOUR = np.array([68, 1, 84]), np.array([253, 231, 37])
"""Vertex colours for no energy and for the maximum: dark violet to yellow, readable in grey and by the colour-blind."""
BRIGHTEST = 0.98
"""This quantile of the energy density, and all above, has the highest colour: else a few triangles take all contrast."""


def read_mesh(
    path: Path,
    closed: bool = False,
    units: str | None = None,
    up: str | None = None,
    around_m: Floats | None = None,
    note: Callable[[str], None] | None = None,
) -> SurfaceMesh:
    """A mesh from an OBJ, PLY or STL file, mended (see ``meshes.cleaned``), in metres and z up.

    :param path: the file.
    :param closed: it must bound a volume.
    :param units: of the file, one of ``meshes.UNITS``; None: metres.
    :param up: the file's axis that points up, one of ``meshes.AXES``; None: z.
    :param around_m: points of what it was drawn around, m, ``(n, 3)``, or None. Units and axes are checked against them; where
        ``up`` is given, they also decide how it stands about that axis.
    :param note: called with each mending, for people; None: nobody is.
    :return: the mesh, m, z up.
    :raises InputError: a file that cannot be read, units or axes that do not fit, or a fault that ``checked_mesh`` finds.
        Messages give the line of an OBJ file, and else the vertex or triangle (from 0).
    """
    path, say = Path(path), note or (lambda what: None)
    if units is not None:
        one_of("units", units, tuple(UNITS))
    if up is not None:
        one_of("up", up, AXES)
    vertices, triangles = read_triangles(path)
    used = vertices[np.unique(triangles)]
    quarters = 0 if around_m is None else _quarters(path, used, units, up, around_m, say)
    fault = size_fault(used, WORN, UNITS[units or "m"])
    if fault is not None:
        raise InputError(f"{path}: {fault if units is None else fault.seen}")
    vertices = in_frame(vertices, UNITS[units or "m"], up or "z", "z", quarters)
    vertices, triangles, mended = cleaned(vertices, triangles, SMALLEST_AREA_M2)
    for what in mended:
        say(f"{path.name}: {what}")
    return checked_mesh(vertices, triangles, str(path), closed)


def _quarters(path: Path, points: Floats, units: str | None, up: str | None, around_m: Floats, say: Callable[[str], None]) -> int:
    """Quarter turns about the vertical; with ``up`` given those that fit, since no key gives the direction that a drawing faces.

    :raises InputError: other units or axes fit, and these do not.
    """
    unit, axis = units or "m", up or "z"
    given = best_fit(points, around_m, (unit,), (axis,), (0,))
    if given.distance_m <= NEAR_M:
        return 0
    if up is not None:
        given = best_fit(points, around_m, (unit,), (axis,))
        if given.distance_m <= NEAR_M:
            say(f"{path.name}: turned by {90 * given.quarter_turns} degrees about the vertical, to lie on the body")
            return given.quarter_turns
    across = extent_of(points)
    found = best_fit(points, around_m, [one for one in UNITS if WORN.has(across * UNITS[one])] or [unit])
    straight = best_fit(points, around_m, (found.unit,), (found.up,), (0,))
    found = straight if straight.distance_m <= NEAR_M else found
    if found.distance_m > NEAR_M:  # too loose: units that shrink it would bring it nearer, axes alone would not
        found = best_fit(points, around_m, (unit,))
    if found.distance_m > LOOSE_M or (
        found.distance_m > NEAR_M and (found.up == axis or found.distance_m > given.distance_m / 2)
    ):
        if units is None or up is None:
            say(f"{path.name}: taken to be in {WORDS[unit]}, {axis} up; in no units and axes does most of it lie on the body")
        return 0
    seen, cure = [], []
    if found.unit != unit:
        seen.append(f"it is {UNITS[unit] * across:.4g} m across; drawn in {WORDS[found.unit]} it lies on the body")
    if found.up != axis:
        seen.append(f"it looks {found.up} up; this body is z up" + ("" if up is None else f", not {up} up"))
    elif found.quarter_turns:
        seen.append("it is turned about the vertical; this body faces -y")
    if found.unit != unit or units is not None:
        cure.append(f"--units {found.unit}")
    if found.up != axis or found.quarter_turns or up is not None:
        cure.append(f"--up {found.up}")
    raise InputError(f"{path}: {'; '.join(seen)}; pass {' '.join(cure)}, as it was drawn")


def write_surface(mesh: SurfaceMesh, comment: str, path: Path, force: bool = False) -> None:
    """A plain OBJ file under a comment.

    :param mesh: what to write.
    :param comment: first line of the file.
    :param path: an .obj file.
    :param force: overwrite a file that exists.
    :raises InputError: another suffix, a file that exists and is not forced, or no such folder.
    """
    one_of(f"suffix of {path.name}", path.suffix.lower(), (".obj",))
    lines = [f"# {comment}; {len(mesh.vertices_m)} vertices, {len(mesh.triangles)} triangles", *_vertex_lines(mesh)]
    lines += ["f {} {} {}".format(*corners) for corners in (mesh.triangles + 1).tolist()]
    with replacing(path, force) as partial:
        partial.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def write_obj(mesh: SurfaceMesh, design: Bools, path: Path, force: bool = False) -> list[Path]:
    """An OBJ file with the groups and materials ``cloth`` and ``reinforcement``, and its MTL file beside it.

    :param mesh: what to write.
    :param design: reinforced triangles, ``(triangles,)``.
    :param path: an .obj file.
    :param force: overwrite files that exist.
    :return: the two paths written.
    :raises InputError: another length of design, another suffix, a file exists and is not forced, or no such folder.
    """
    path = _target(path, ".obj", mesh, design)
    materials = path.with_suffix(".mtl")
    for target in (path, materials):
        refuse_existing(target, force)
    lines = [f"# metres; {len(mesh.vertices_m)} vertices, {len(mesh.triangles)} triangles", f"mtllib {materials.name}"]
    lines += _vertex_lines(mesh)
    for name, where in (("cloth", ~design), ("reinforcement", design)):
        lines += [
            f"g {name}",
            f"usemtl {name}",
            *("f {} {} {}".format(*corners) for corners in (mesh.triangles[where] + 1).tolist()),
        ]
    colours = "newmtl cloth\nKd 0.8 0.8 0.8\n\nnewmtl reinforcement\nKd 0.15 0.3 0.75\n"
    with replacing(path, force) as partial:
        partial.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    with replacing(materials, force) as partial:
        partial.write_text(colours, encoding="utf-8", newline="\n")
    return [path, materials]


def write_ply(mesh: SurfaceMesh, design: Bools, energy_j: Floats, path: Path, force: bool = False) -> list[Path]:
    """A binary PLY file: per triangle ``energy_j_m2`` and ``reinforced`` (1 or 0); vertices coloured by energy density.

    :param mesh: what to write.
    :param design: reinforced triangles, ``(triangles,)``.
    :param energy_j: strain energy of each triangle, J, ``(triangles,)``.
    :param path: a .ply file.
    :param force: overwrite a file that exists.
    :return: the path written.
    :raises InputError: as in ``write_obj``, or energies that are not finite or of another length.
    """
    path = _target(path, ".ply", mesh, design)
    if energy_j.shape != design.shape or not np.isfinite(energy_j).all():
        raise InputError(
            f"{path}: energies of shape {energy_j.shape}, or not finite; expected finite numbers of shape {design.shape}"
        )
    density_j_m2 = energy_j / mesh.areas_m2
    vertex = np.zeros(len(mesh.vertices_m), [(name, "<f8") for name in "xyz"] + [(name, "u1") for name in _COLOURS])
    for i, name in enumerate("xyz"):
        vertex[name] = mesh.vertices_m[:, i]
    for i, name in enumerate(_COLOURS):
        vertex[name] = _colours(mesh.triangles, mesh.areas_m2, density_j_m2, len(mesh.vertices_m))[:, i]
    # The properties of a face share one type: libigl, for one, fails on a mixture.
    face = np.zeros(len(mesh.triangles), [("count", "u1"), ("corners", "<i4", 3), ("energy_j_m2", "<f4"), ("reinforced", "<f4")])
    face["count"], face["corners"], face["energy_j_m2"], face["reinforced"] = 3, mesh.triangles, density_j_m2, design
    header = [
        *("ply", "format binary_little_endian 1.0", "comment metres", f"element vertex {len(vertex)}"),
        *(f"property double {name}" for name in "xyz"),
        *(f"property uchar {name}" for name in _COLOURS),
        *(f"element face {len(face)}", "property list uchar int vertex_indices"),
        *("property float energy_j_m2", "property float reinforced", "end_header"),
    ]
    with replacing(path, force) as partial:
        partial.write_bytes("\n".join(header).encode() + b"\n" + vertex.tobytes() + face.tobytes())
    return [path]


def _vertex_lines(mesh: SurfaceMesh) -> list[str]:
    return ["v {!r} {!r} {!r}".format(*vertex) for vertex in mesh.vertices_m.tolist()]


_COLOURS = ("red", "green", "blue")


def _target(path: Path, suffix: str, mesh: SurfaceMesh, design: Bools) -> Path:
    path = Path(path)
    one_of(f"suffix of {path.name}", path.suffix.lower(), (suffix,))
    if design.shape != (len(mesh.triangles),) or design.dtype != np.bool_:
        raise InputError(f"{path}: the design is {design.dtype} of shape {design.shape}; expected bool, ({len(mesh.triangles)},)")
    return path


def _colours(triangles: Ints, areas_m2: Floats, density_j_m2: Floats, vertices: int) -> Ints:
    """The area-weighted mean of the density round each vertex as a colour, ``(vertices, 3)``."""
    corners, areas = triangles.ravel(), np.repeat(areas_m2, 3)
    total = np.bincount(corners, np.repeat(density_j_m2, 3) * areas, minlength=vertices)
    density = total / np.maximum(np.bincount(corners, areas, minlength=vertices), 1e-300)
    share = np.clip(density / max(float(np.quantile(density, BRIGHTEST)), 1e-300), 0.0, 1.0)[:, None]
    return np.rint((1 - share) * LOWEST_COLOUR + share * HIGHEST_COLOUR).astype(np.int64)
