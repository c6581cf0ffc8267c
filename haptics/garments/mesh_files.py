"""Garments and bodies as mesh files: read in metres and checked; written with the design and the energy for any viewer."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from haptics.errors import InputError
from haptics.garments.mesh import Bools, Floats, Ints, SurfaceMesh, checked_mesh
from haptics.recording.output import refuse_existing, replacing
from haptics.units import one_of

FORMATS = (".obj", ".ply", ".stl")
LOWEST_COLOUR, HIGHEST_COLOUR = np.array([68, 1, 84]), np.array([253, 231, 37])
"""Vertex colours for no energy and for the most: dark violet to yellow, readable in grey and by the colour-blind."""
BRIGHTEST = 0.98
"""This quantile of the energy density, and all above, has the highest colour: a few triangles would else take all contrast."""


def read_mesh(path: Path, closed: bool = False) -> SurfaceMesh:
    """A mesh from an OBJ, PLY or STL file, coordinates in metres.

    :param closed: it must bound a volume.
    :raises InputError: no such file, another format, unreadable, trimesh missing, or a fault that ``checked_mesh`` finds.
        Messages give the line of an OBJ file, and else the vertex or triangle (from 0).
    """
    path = Path(path)
    one_of(f"type of mesh file {path.name}", path.suffix.lower(), FORMATS)
    if not path.is_file():
        raise InputError(f"{path} is not a file; allowed: a mesh as {', '.join(FORMATS)}")
    vertices, triangles = _read_obj(path) if path.suffix.lower() == ".obj" else _read_by_trimesh(path)
    return checked_mesh(vertices, triangles, str(path), closed)


def _read_by_trimesh(path: Path) -> tuple[Floats, Ints]:
    try:
        import trimesh
    except ImportError as error:
        raise InputError(f"{path} needs trimesh to be read; install it with: pip install 'wearable-haptics[garment]'") from error
    try:
        with path.open("rb") as file:
            found = trimesh.load_mesh(file, file_type=path.suffix[1:].lower(), process=False)
        vertices, triangles = np.asarray(found.vertices, float), np.asarray(found.faces, np.int64)
    except Exception as error:  # the reader has no error type of its own: whatever it raises, the file is broken
        raise InputError(f"{path} cannot be read as {path.suffix[1:].upper()}: {error}") from error
    if path.suffix.lower() == ".stl":  # every triangle has its own corners there
        vertices, number = np.unique(vertices, axis=0, return_inverse=True)
        triangles = number.ravel()[triangles]
    return vertices, triangles


def _read_obj(path: Path) -> tuple[Floats, Ints]:
    """Positions and faces only, polygons fanned: general readers part the mesh where groups, materials or textures meet."""
    vertices: list[list[float]] = []
    faces: list[tuple[int, str, list[int]]] = []
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        words = line.split("#")[0].split()
        try:
            if words[:1] == ["v"]:
                vertices.append([float(word) for word in words[1:4]])
                if len(vertices[-1]) != 3 or not np.isfinite(vertices[-1]).all():
                    raise ValueError
            elif words[:1] == ["f"]:
                corners = [int(word.split("/")[0]) for word in words[1:]]
                # Negative numbers count back from the last vertex so far.
                faces.append((number, line, [corner - 1 if corner > 0 else len(vertices) + corner for corner in corners]))
                if len(corners) < 3 or 0 in corners:
                    raise ValueError
        except ValueError as error:
            allowed = (
                "v and three finite coordinates in metres" if words[0] == "v" else "f and at least three vertex numbers, from 1"
            )
            raise InputError(f"{path}, line {number}: {line.strip()!r}; allowed: {allowed}") from error
    for number, line, corners in faces:
        if not all(0 <= corner < len(vertices) for corner in corners):
            raise InputError(f"{path}, line {number}: {line.strip()!r}; allowed: vertices 1 to {len(vertices)}")
    fans = [(corners[0], *pair) for _, _, corners in faces for pair in pairwise(corners[1:])]
    return np.array(vertices).reshape(-1, 3), np.array(fans, np.int64).reshape(-1, 3)


def write_obj(mesh: SurfaceMesh, design: Bools, path: Path, force: bool = False) -> list[Path]:
    """An OBJ file with the groups and materials ``cloth`` and ``reinforcement``, and its MTL file beside it; the paths written.

    :param design: reinforced triangles, ``(triangles,)``.
    :raises InputError: another length of design, another suffix, a file exists and is not forced, or no such folder.
    """
    path = _target(path, ".obj", mesh, design)
    materials = path.with_suffix(".mtl")
    for target in (path, materials):
        refuse_existing(target, force)
    lines = [f"# metres; {len(mesh.vertices_m)} vertices, {len(mesh.triangles)} triangles", f"mtllib {materials.name}"]
    lines += ["v {!r} {!r} {!r}".format(*vertex) for vertex in mesh.vertices_m.tolist()]
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

    :param design: reinforced triangles, ``(triangles,)``.
    :param energy_j: strain energy of each triangle, ``(triangles,)``.
    :return: the path written.
    :raises InputError: as ``write_obj``, or energies that are not finite or of another length.
    """
    path = _target(path, ".ply", mesh, design)
    if energy_j.shape != design.shape or not np.isfinite(energy_j).all():
        raise InputError(f"{path}: energies of shape {energy_j.shape}; allowed: finite, shape {design.shape}, one a triangle")
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


_COLOURS = ("red", "green", "blue")


def _target(path: Path, suffix: str, mesh: SurfaceMesh, design: Bools) -> Path:
    path = Path(path)
    one_of(f"suffix of {path.name}", path.suffix.lower(), (suffix,))
    if design.shape != (len(mesh.triangles),) or design.dtype != np.bool_:
        raise InputError(f"{path}: the design is {design.dtype} of shape {design.shape}; allowed: bool, ({len(mesh.triangles)},)")
    return path


def _colours(triangles: Ints, areas_m2: Floats, density_j_m2: Floats, vertices: int) -> Ints:
    """The area-weighted mean of the density round each vertex as a colour, ``(vertices, 3)``."""
    corners, areas = triangles.ravel(), np.repeat(areas_m2, 3)
    total = np.bincount(corners, np.repeat(density_j_m2, 3) * areas, minlength=vertices)
    density = total / np.maximum(np.bincount(corners, areas, minlength=vertices), 1e-300)
    share = np.clip(density / max(float(np.quantile(density, BRIGHTEST)), 1e-300), 0.0, 1.0)[:, None]
    return np.rint((1 - share) * LOWEST_COLOUR + share * HIGHEST_COLOUR).astype(np.int64)
