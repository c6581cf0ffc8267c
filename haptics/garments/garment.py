"""Garments: which part of the body's skin each covers, cut out of it and made as fine as asked.

A garment's vertices are mixtures of the body's vertices, so that a posed body carries its garment along (thesis 5.4.4.1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from haptics.errors import InputError
from haptics.garments.bodies.body import Body
from haptics.garments.cut.coarsening import anchored, coarsened
from haptics.garments.cut.cutting import cut_out, largest_piece, openings
from haptics.garments.cut.subdivision import Sparse, loop
from haptics.garments.mesh import Bools, Floats, Ints, SurfaceMesh, checked_mesh
from haptics.garments.mesh_files import read_mesh
from haptics.meshes import FORMATS
from haptics.units import one_of

LEVELS = {"coarse": 500, "draft": 1800, "standard": 7000, "reference": 28000}
"""About how many vertices a garment has at each level."""
OWN = "own"
"""The level of a garment that comes as a mesh: it stays as fine as it was drawn."""

OPENINGS = {"sleeve": 2, "knee_sleeve": 2, "shirt": 4, "long_shirt": 4, "shorts": 3}
"""How many openings each garment has."""
GARMENTS = tuple(OPENINGS)

BAND_M = 0.0175
"""Width of the attachment band at each opening: what elastics and straps are wide. Assumed."""
KNEE_REACH_M = 0.18
"""How far the knee sleeve reaches from the knee, up and down. Assumed."""
SHORT_SLEEVE, SHORTS_LEG = 0.5, 0.85
"""Where the shirt's sleeves and the legs of the shorts end, along the upper arm and the upper leg. Assumed."""
_FEWEST, _MAX = 0.83, 1.1
"""Shares of a level's vertices: a mesh with fewer is subdivided, one with more is made coarser."""


@dataclass(frozen=True, eq=False)
class Garment:
    """A garment's mesh, tied to a body's vertices.

    :param name: one of ``GARMENTS``, or the mesh's name.
    :param level: one of ``LEVELS``, or ``OWN``.
    :param triangles: ``(triangles, 3)``, anticlockwise seen from outside.
    :param weights: each vertex as a mixture of the body's, rows sum to 1, ``(vertices, body vertices)``.
    :param attached: triangles that elastics or straps hold to the body (thesis 5.4.3), ``(triangles,)``: a band at each opening.
    :param designable: triangles that may be reinforced, ``(triangles,)``. All: reinforcement may end in a band.
    :param notes: what was mended of a mesh that it comes from, for people.
    """

    name: str
    level: str
    triangles: Ints
    weights: Sparse
    attached: Bools
    designable: Bools
    notes: tuple[str, ...] = ()

    def on(self, body_vertices_m: Floats) -> Floats:
        """The garment's vertices on the body in a pose.

        :param body_vertices_m: the body's vertices, m, ``(body vertices, 3)``.
        :return: positions, m, ``(vertices, 3)``.
        """
        return np.asarray(self.weights @ body_vertices_m)


def mesh_of(garment: str) -> Path | None:
    """The file, where ``garment`` is one of a mesh rather than one of ``GARMENTS``.

    :param garment: a name or a file's name.
    :return: the file; None where ``garment`` is one of ``GARMENTS``.
    :raises InputError: it is neither a name nor a file that exists.
    """
    if garment in GARMENTS:
        return None
    path = Path(garment)
    if path.suffix.lower() not in FORMATS:
        raise InputError(
            f"garment = {garment!r} is not allowed; allowed: {', '.join(GARMENTS)}, or a mesh file as {', '.join(FORMATS)}"
        )
    try:
        there = path.is_file()
    except OSError:  # a name that no file can have
        there = False
    if not there:
        raise InputError(
            f"garment = {garment!r} is not a file; expected a mesh file that exists, or one of {', '.join(GARMENTS)}"
        )
    return path


def open_garment(body: Body, name: str, level: str, units: str | None = None, up: str | None = None) -> Garment:
    """A garment by name, as ``cut_garment``, or from a mesh file around the straight body, as ``garment_from_mesh``.

    :param body: the body, whose straight pose a mesh is laid onto.
    :param name: one of ``GARMENTS``, or the file of a mesh.
    :param level: one of ``LEVELS``; ``OWN`` for a mesh.
    :param units: of a mesh, as ``read_mesh`` takes them; None: metres.
    :param up: of a mesh, as ``read_mesh`` takes it; None: z.
    :return: the garment.
    :raises InputError: a name, a file or a level that is not allowed.
    """
    path = mesh_of(name)
    if path is None:
        refuse_frame(name, units, up)
        return cut_garment(body, name, level)
    one_of("level of a garment from a mesh", level, (OWN,))
    notes: list[str] = []
    mesh = read_mesh(path, units=units, up=up, around_m=body.straight_m, note=notes.append)
    mesh = _facing_outward(body, mesh, lambda what: notes.append(f"{path.name}: {what}"))
    return replace(garment_from_mesh(body, mesh), name=path.stem, notes=tuple(notes))


def refuse_frame(garment: str, units: str | None, up: str | None) -> None:
    """Refuse units and an axis for a garment that is not a mesh.

    :param garment: what was given as the garment.
    :param units: units given for it, or None.
    :param up: axis given for it, or None.
    :raises InputError: either is not None.
    """
    if units is not None or up is not None:
        raise InputError(f"units = {units!r}, up = {up!r}: {garment!r} is no mesh file; pass --units and --up only with one")


def cut_garment(body: Body, name: str, level: str = "draft") -> Garment:
    """A garment cut out of the straight body's skin.

    :param body: the body, straight.
    :param name: one of ``GARMENTS``. sleeve: the left arm from shoulder to wrist; knee_sleeve: 18 cm up and down from the left
        knee; shirt: trunk and half of the upper arms; long_shirt: trunk and arms to the wrists; shorts: pelvis and legs to above
        the knees.
    :param level: one of ``LEVELS``.
    :return: the garment, tied to the body's vertices.
    :raises InputError: an unknown name, or a body out of which no such garment can be cut.
    """
    one_of("garment", name, GARMENTS)
    one_of("level", level, tuple(LEVELS))
    weights, triangles = cut_out(body.straight_m, body.triangles, _covered(body, name))
    found = openings(triangles)
    if found != OPENINGS[name]:
        raise InputError(f"{name} cut out of body {body.name} has {found} openings; expected {OPENINGS[name]}")
    while weights.shape[0] < LEVELS[level] * _FEWEST:
        finer, triangles = loop(triangles, weights.shape[0])
        weights = finer @ weights
    if weights.shape[0] > LEVELS[level] * _MAX:
        fewer, triangles = coarsened(weights @ body.straight_m, triangles, LEVELS[level])
        weights = fewer @ weights
    mesh = checked_mesh(weights @ body.straight_m, triangles, f"{name} on body {body.name}")
    return Garment(name, level, mesh.triangles, weights, _bands(mesh), np.ones(len(triangles), dtype=bool))


def garment_from_mesh(body: Body, mesh: SurfaceMesh, attached: Bools | None = None, farthest_m: float = 0.03) -> Garment:
    """A garment drawn elsewhere around the straight body, tied to the nearest points of its skin.

    :param body: the body, straight.
    :param mesh: one sheet of cloth with openings, m, z up.
    :param attached: the triangles held to the body, ``(triangles,)``; None: a band at each opening.
    :param farthest_m: largest distance of a vertex from the skin, m.
    :return: the garment at level ``OWN``.
    :raises InputError: a faulty mesh, more than one piece, a vertex farther than ``farthest_m`` from the skin (the message names
        it), triangles that face the body, no opening and no attachment given, or an attachment of another size.
    """
    checked = checked_mesh(mesh.vertices_m, mesh.triangles, mesh.name)
    weights, distance = anchored(checked.vertices_m, body.straight_m, body.triangles)
    far = int(distance.argmax())
    if distance[far] > farthest_m:
        place = "({:.3f}, {:.3f}, {:.3f}) m".format(*checked.vertices_m[far])
        raise InputError(
            f"{mesh.name}: vertex {far} at {place} is {distance[far]:.3f} m from body {body.name}; "
            f"allowed: at most {farthest_m:g} m; draw around what `haptics garment bodies --export body.obj` writes"
        )
    if attached is None and not len(checked.boundary_edges):
        raise InputError(
            f"{mesh.name}: it has no opening to be attached at; "
            "expected one sheet with a boundary, not a solid (or pass attached)"
        )
    held = _bands(checked) if attached is None else np.asarray(attached, dtype=bool)
    if held.shape != (len(checked.triangles),):
        raise InputError(f"{mesh.name}: attached has shape {held.shape}; expected ({len(checked.triangles)},)")
    on_skin = checked_mesh(weights @ body.straight_m, checked.triangles, f"{mesh.name} laid onto body {body.name}")
    _refuse_pieces(checked)
    _refuse_inside_out(checked, on_skin, weights @ SurfaceMesh(body.straight_m, body.triangles).vertex_normals)
    return Garment(mesh.name, OWN, on_skin.triangles, weights, held, np.ones(len(held), dtype=bool))


def _refuse_pieces(mesh: SurfaceMesh) -> None:
    piece = largest_piece(mesh.triangles)
    if len(piece) < len(mesh.triangles):
        other = int(np.setdiff1d(mesh.triangles, piece)[0])
        place = "({:.3f}, {:.3f}, {:.3f}) m".format(*mesh.vertices_m[other])
        raise InputError(
            f"{mesh.name}: vertex {other} at {place} is not joined to the rest; "
            "expected one piece in one layer, with the cloth between its parts"
        )


def _refuse_inside_out(mesh: SurfaceMesh, on_skin: SurfaceMesh, outward: Floats) -> None:
    """Neighbours are turned alike already, so that all triangles face outward or none does."""
    faces = _outward_m2(on_skin, outward)
    if faces.sum() < 0:
        first = int(faces.argmin())
        place = "({:.3f}, {:.3f}, {:.3f}) m".format(*mesh.centres_m[first])
        raise InputError(
            f"{mesh.name}: it is inside out, triangle {first} at {place} faces the body; "
            "expected all triangles anticlockwise seen from outside"
        )


def _facing_outward(body: Body, mesh: SurfaceMesh, note: Callable[[str], None]) -> SurfaceMesh:
    weights, _ = anchored(mesh.vertices_m, body.straight_m, body.triangles)
    normals = weights @ SurfaceMesh(body.straight_m, body.triangles).vertex_normals
    if _outward_m2(mesh.at(weights @ body.straight_m), normals).sum() >= 0:
        return mesh
    note(f"it was inside out: all {len(mesh.triangles)} triangles turned")
    return SurfaceMesh(mesh.vertices_m, np.ascontiguousarray(mesh.triangles[:, ::-1]), mesh.name)


def _outward_m2(on_skin: SurfaceMesh, outward: Floats) -> Floats:
    """How far each triangle on the skin faces as the skin does, by twice its area."""
    return np.einsum("ij,ij->i", on_skin.cross_m2, outward[on_skin.triangles].mean(axis=1))


def _covered(body: Body, name: str) -> Floats:
    """Above 0 where the garment covers the body's vertex, below 0 where not, ``(vertices,)``."""
    weight, at, points = body.part_weights, body.joints_m, body.straight_m
    if name == "sleeve":
        return weight["upper_arm_l"] + weight["lower_arm_l"] - 0.5
    if name == "knee_sleeve":
        leg = at["knee_l"] - at["hip_l"]
        along_m = (points - at["knee_l"]) @ leg / np.linalg.norm(leg)
        own = weight["upper_leg_l"] + weight["lower_leg_l"] > 0.5
        return np.where(own, KNEE_REACH_M - np.abs(along_m), -KNEE_REACH_M)
    if name == "shorts":
        covered = weight["pelvis"] + weight["upper_leg_l"] + weight["upper_leg_r"] - 0.5
        return _shortened(covered, body, "upper_leg", "hip", "knee", SHORTS_LEG)
    covered = weight["torso"] + sum(weight[f"upper_arm_{side}"] for side in "lr") - 0.5
    if name == "shirt":
        return _shortened(covered, body, "upper_arm", "shoulder", "elbow", SHORT_SLEEVE)
    return covered + sum(weight[f"lower_arm_{side}"] for side in "lr")


def _shortened(covered: Floats, body: Body, part: str, joint: str, end: str, share: float) -> Floats:
    """The same without what lies beyond a share of the distance between two joints."""
    for side in "lr":
        start, bone = body.joints_m[f"{joint}_{side}"], body.joints_m[f"{end}_{side}"] - body.joints_m[f"{joint}_{side}"]
        beyond = (body.straight_m - start) @ bone / (bone @ bone) - share
        covered = np.where(body.part_weights[f"{part}_{side}"] > 0.5, np.minimum(covered, -beyond), covered)
    return covered


def _bands(mesh: SurfaceMesh) -> Bools:
    """Triangles whose centre is within the band's width of an opening, in a straight line.

    On a limb 4 cm in radius that is 0.1 mm less than along the skin. It does not depend on how fine the mesh is.
    """
    from scipy.spatial import KDTree

    start, end = (mesh.vertices_m[mesh.boundary_edges[:, i]] for i in range(2))
    pieces = max(2, int(np.ceil(np.linalg.norm(end - start, axis=1).max() / 1e-3)))
    along = (np.arange(pieces) / pieces)[:, None, None]
    rim = ((1 - along) * start + along * end).reshape(-1, 3)
    distance, _ = KDTree(rim).query(mesh.centres_m)
    return np.asarray(distance < BAND_M)
