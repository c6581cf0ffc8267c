"""The pattern of a garment: its panels laid flat, the reinforcement to cut for each, and which edges are sewn to which."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from string import ascii_uppercase

import numpy as np

from haptics.errors import InputError
from haptics.garments.mesh import Bools, Floats, Ints, SurfaceMesh
from haptics.garments.pattern.cloth import Cloth
from haptics.garments.pattern.flatten import gradients
from haptics.garments.pattern.outline import Reinforcement, reinforcement, too_narrow, with_allowance
from haptics.garments.pattern.seams import FlatPanel, cut_to_fit
from haptics.units import in_range

Place = tuple[float, float]


@dataclass(frozen=True)
class PatternOptions:
    """How a pattern is made. Directions are in the garment's space; all lengths in metres.

    :param front: where the wearer faces.
    :param seam_side: where a tube's seam goes, seen from its axis.
    :param up: laid upwards on the sheet, marked by the arrow from ``down_label`` to ``up_label``; None takes (0, 0, 1), or on a
        tube the direction from its lower opening to its upper.
    :param up_label: printed at the arrow's head.
    :param down_label: printed at its tail.
    :param max_distortion: panels with a larger root mean square error of lengths are halved, 0.001 to 1.
    :param max_panels: as long as there are fewer than this, 1 to 26.
    :param smoothing_m: smoothing length of the reinforcement's outline, 0 (none) to 0.1; None takes the mean edge of the mesh.
    :param smallest_feature_m: what the cutter can do; narrower places are reported, 0 to 0.05.
    :param seam_allowance_m: added round the cloth, 0 to 0.05.
    :param sheet_width_m: of the cutter; 0.61 is the 24 inch of a Silhouette Cameo 4 Pro, 0.305 that of a Cameo 4. 0.2 to 5.
    :param sheet_length_m: longest sheet, 0.1 to 50.
    :param margin_m: left free at the sheet's edges and between panels, 0.008 (the corner marks' size) to 0.1.
    :param notch_spacing_m: about this far apart along seams, 0.02 to 1.
    :param mirrored: sheet seen from the inside of the garment, as transfer film is cut.
    """

    front: tuple[float, float, float] = (0.0, -1.0, 0.0)
    seam_side: tuple[float, float, float] = (0.0, 1.0, 0.0)
    up: tuple[float, float, float] | None = None
    up_label: str = "up"
    down_label: str = "down"
    max_distortion: float = 0.03
    max_panels: int = 8
    smoothing_m: float | None = None
    smallest_feature_m: float = 2e-3
    seam_allowance_m: float = 0.0
    sheet_width_m: float = 0.61
    sheet_length_m: float = 3.0
    margin_m: float = 0.015
    notch_spacing_m: float = 0.1
    mirrored: bool = False

    def __post_init__(self) -> None:
        for name in ("front", "seam_side", *(("up",) if self.up is not None else ())):
            direction = np.asarray(getattr(self, name), float)
            if direction.shape != (3,) or not np.isfinite(direction).all() or not np.linalg.norm(direction) > 0:
                raise InputError(f"{name} = {getattr(self, name)!r} is not a direction; expected three finite numbers, not all 0")
        in_range("max_distortion", self.max_distortion, 0.001, 1.0)
        in_range("max_panels", self.max_panels, 1, len(ascii_uppercase))
        if self.smoothing_m is not None:
            in_range("smoothing_m", self.smoothing_m, 0.0, 0.1, "m")
        in_range("smallest_feature_m", self.smallest_feature_m, 0.0, 0.05, "m")
        in_range("seam_allowance_m", self.seam_allowance_m, 0.0, 0.05, "m")
        in_range("sheet_width_m", self.sheet_width_m, 0.2, 5.0, "m")
        in_range("sheet_length_m", self.sheet_length_m, 0.1, 50.0, "m")
        in_range("margin_m", self.margin_m, 0.008, 0.1, "m")
        in_range("notch_spacing_m", self.notch_spacing_m, 0.02, 1.0, "m")


def direction(vector: tuple[float, float, float]) -> Floats:
    """The unit vector along a vector.

    :param vector: not all zero.
    :return: ``(3,)``.
    """
    return np.asarray(vector, float) / np.linalg.norm(vector)


@dataclass(frozen=True, eq=False)
class PatternPanel:
    """One piece to cut, its ``up`` along +y, seen from outside, m.

    :param name: A, B, ...
    :param flat: the panel and its flat vertices, with the distortion.
    :param parents: for each triangle that of the garment, ``(triangles,)``.
    :param reinforced: reinforced triangles of the panel, ``(triangles,)``.
    :param outline_m: line to cut the cloth along, m, ``(points, 2)``.
    :param cut: what to cut from the reinforcing sheet.
    :param narrow: places narrower than the cutter's smallest feature.
    """

    name: str
    flat: FlatPanel
    parents: Ints
    reinforced: Bools
    outline_m: Floats
    cut: Reinforcement
    narrow: list[Place]


@dataclass(frozen=True, eq=False)
class SeamSide:
    """One of the two edges that a seam joins.

    :param panel: index of its panel in the pattern.
    :param points_m: line on the flat panel, m, ``(points, 2)``.
    """

    panel: int
    points_m: Floats

    @property
    def length_m(self) -> float:
        """Length of the line, m."""
        return float(np.linalg.norm(np.diff(self.points_m, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class Seam:
    """Two edges to sew together; point k of one side meets point k of the other.

    :param number: from 1, as printed at its notches.
    :param along_m: distance on the body from the seam's start to each point, m, ``(points,)``.
    :param sides: the two edges; point k of one is sewn to point k of the other.
    :param notches_m: distances on the body at which notches are, m, ``(notches,)``.
    """

    number: int
    along_m: Floats
    sides: tuple[SeamSide, SeamSide]
    notches_m: Floats

    @property
    def length_m(self) -> float:
        """Length on the body, m."""
        return float(self.along_m[-1])

    def notches(self, side: SeamSide) -> Floats:
        """Where the notches are on a side.

        :param side: one of ``sides``.
        :return: positions on the flat panel, m, ``(notches, 2)``.
        """
        return np.stack([np.interp(self.notches_m, self.along_m, side.points_m[:, i]) for i in range(2)], axis=1)


@dataclass(frozen=True, eq=False)
class Pattern:
    """All panels and seams of one garment and design.

    :param name: the garment's.
    :param labels: printed on the sheet, by their names.
    :param options: how it was made.
    :param panels: pieces to cut, named A, B, ...
    :param seams: which edges are sewn together.
    :param reinforced_area_m2: area of the reinforcement on the body, m2.
    """

    name: str
    labels: Mapping[str, str]
    options: PatternOptions
    panels: list[PatternPanel]
    seams: list[Seam]
    reinforced_area_m2: float

    @property
    def cut_area_m2(self) -> float:
        """Area of all reinforcement to cut."""
        return sum(panel.cut.area_m2 for panel in self.panels)

    @property
    def flat_area_ratio(self) -> float:
        """Area of the reinforced triangles laid flat over their area on the body."""
        flat = sum(panel.cut.mesh_area_m2 for panel in self.panels)
        return flat / self.reinforced_area_m2 if self.reinforced_area_m2 else 1.0


def make_pattern(
    rest: SurfaceMesh, design: Bools, name: str, labels: Mapping[str, str] | None = None, options: PatternOptions | None = None
) -> Pattern:
    """The pattern of a garment in its rest shape, with a design pressed on.

    :param rest: the garment without stretch.
    :param design: reinforced triangles, ``(triangles,)``.
    :param name: printed on the sheet.
    :param labels: printed on the sheet: body, motion, coverage, and the like; None prints none.
    :param options: how to cut and lay out; None takes the defaults.
    :return: panels, seams and the outlines to cut.
    :raises InputError: a design of another length; a label that cannot be printed; a garment that cannot be cut into discs or
        laid flat; a package is missing.
    """
    options, labels = options or PatternOptions(), labels or {}
    if design.shape != (len(rest.triangles),) or design.dtype != np.bool_:
        raise InputError(
            f"{name}: the design is {design.dtype} of shape {design.shape}; expected bool, one for each triangle, "
            f"({len(rest.triangles)},)"
        )
    for text in (name, *labels, *labels.values(), options.up_label, options.down_label):
        if not text.isprintable():
            raise InputError(f"label {text!r} cannot be printed; expected text on one line without control characters")
    front, side = direction(options.front), direction(options.seam_side)
    up = _upwards(rest) if options.up is None else direction(options.up)
    cloth, flats = cut_to_fit(rest, design, front, side, options.max_distortion, options.max_panels)
    edges = rest.vertices_m[rest.edges]
    smoothing_m = float(np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).mean())
    smoothing_m = smoothing_m if options.smoothing_m is None else options.smoothing_m
    panels: list[PatternPanel] = []
    for letter, flat in zip(ascii_uppercase, flats, strict=False):
        turned = _turned(flat, up)
        parents = cloth.parents[flat.panel.faces]
        cut = reinforcement(turned, design[parents], smoothing_m)
        narrow = too_narrow(cut.polygons, options.smallest_feature_m) if options.smallest_feature_m else []
        outline = with_allowance(turned, options.seam_allowance_m)
        panels.append(PatternPanel(letter, turned, parents, design[parents], outline, cut, narrow))
    seams = _seams(cloth, panels, options.notch_spacing_m)
    return Pattern(name, dict(labels), options, panels, seams, float(rest.areas_m2[design].sum()))


def _upwards(rest: SurfaceMesh) -> Floats:
    """Along a tube from its lower opening to its upper; (0, 0, 1) for other garments."""
    whole = Cloth.uncut(rest).panels[0]
    if len(whole.loops) != 2:
        return np.array([0.0, 0.0, 1.0])
    one, other = (whole.mesh.vertices_m[loop].mean(axis=0) for loop in whole.loops)
    axis = (other - one) / np.linalg.norm(other - one)
    return axis if axis[2] >= 0 else -axis


def _turned(flat: FlatPanel, up: Floats) -> FlatPanel:
    """The panel turned so that the garment's ``up`` is, on average, +y."""
    mesh = flat.panel.mesh
    a, b = mesh.vertices_m[mesh.triangles[:, 0]], mesh.vertices_m[mesh.triangles[:, 1]]
    along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    across = np.cross(mesh.cross_m2 / (2 * mesh.areas_m2[:, None]), along)
    upwards = mesh.areas_m2 @ np.einsum("fij,fj->fi", gradients(mesh, flat.flat_m), np.stack([along @ up, across @ up], axis=1))
    x, y = upwards / max(np.linalg.norm(upwards), 1e-12)
    return FlatPanel(flat.panel, flat.flat_m @ np.array([[y, x], [-x, y]]) if np.hypot(x, y) > 0.5 else flat.flat_m)


def _seams(cloth: Cloth, panels: list[PatternPanel], spacing_m: float) -> list[Seam]:
    """Chains of cut edges between junctions and openings, numbered by their lowest vertex."""
    sides: dict[tuple[int, int], tuple[int, int, int]] = {}
    for number, panel in enumerate(panels):
        origin = panel.flat.panel.origin
        for a, b in panel.flat.panel.mesh.boundary_edges.tolist():
            sides[int(origin[a]), int(origin[b])] = (number, a, b)
    seams: list[Seam] = []
    for chain in _chains(cloth):
        points = cloth.mesh.vertices_m[chain]
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        count = max(1, round(along[-1] / spacing_m) - 1)
        notches = along[-1] * np.arange(1, count + 1) / (count + 1)
        left = _side(chain, panels, sides)
        right = _side(chain[::-1], panels, sides)
        seams.append(Seam(len(seams) + 1, along, (left, SeamSide(right.panel, right.points_m[::-1])), notches))
    return seams


def _side(chain: list[int], panels: list[PatternPanel], sides: dict[tuple[int, int], tuple[int, int, int]]) -> SeamSide:
    steps = [sides[a, b] for a, b in pairwise(chain)]
    panel = panels[steps[0][0]].flat
    return SeamSide(steps[0][0], panel.flat_m[[step[1] for step in steps] + [steps[-1][2]]])


def _chains(cloth: Cloth) -> list[list[int]]:
    neighbours: dict[int, list[int]] = {}
    for a, b in cloth.seams.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    openings = set(cloth.mesh.boundary_edges.ravel().tolist())
    ends = {vertex for vertex, others in neighbours.items() if len(others) != 2 or vertex in openings}
    walked: set[tuple[int, int]] = set()
    chains: list[list[int]] = []
    for start in sorted(ends):
        for following in sorted(neighbours[start]):
            if (start, following) in walked:
                continue
            chain = [start, following]
            while chain[-1] not in ends:
                chain.append(next(vertex for vertex in neighbours[chain[-1]] if vertex != chain[-2]))
            walked |= {(start, following), (chain[-1], chain[-2])}
            chains.append(chain)
    return chains
