"""Where the seams of a garment go, so that every panel is a disc that can be laid flat.

A tube (sleeve, knee sleeve) gets one seam between its two openings, on the side that is asked for and clear of the
reinforcement. A garment with more openings (shirt, shorts) is parted into front and back, as tailors do: along the sides, over
the shoulders, under the arms, between the legs. A panel that still cannot be laid flat within the bound is halved, across or
along, whichever lowers its distortion further.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from haptics.errors import InputError
from haptics.garments.cut.coarsening import libigl
from haptics.garments.mesh import Bools, Floats, Ints, SurfaceMesh
from haptics.garments.pattern.cloth import Cloth, Panel
from haptics.garments.pattern.flatten import SETTLED, Distortion, distortion, flatten, gradients

REINFORCED_DEARER = 8.0
"""A seam goes this much farther (and once) round rather than through reinforcement."""
FAR_SIDE_DEARER = 2.0
"""A seam goes up to this much farther (and once) rather than on the far side of the limb."""
SMOOTHED_OVER = (4, 3, 2, 1)
"""Edges to each side of a path of edges over which it is made a smooth line: the first number that fits is taken."""
FACING_SMOOTHED_M = (0.01, 0.02, 0.04, 0.08)
"""Lengths over which the cloth's facing is smoothed to part front and back: the first that gives two discs is taken."""
SMALLEST_SHARE = 0.08
"""No panel is halved into a part of less than this share of it."""
ROUGHLY_SETTLED = 0.01
"""How far panels are flattened to compare places for a seam: see ``flatten``."""
WORTH_A_SEAM = 0.9
"""A seam must bring the error of lengths below this share of what it was."""


@dataclass(frozen=True, eq=False)
class FlatPanel:
    """A panel and where its vertices lie on the table.

    :param panel: the piece in space.
    :param flat_m: its flat positions, m, ``(vertices, 2)``.
    """

    panel: Panel
    flat_m: Floats

    @cached_property
    def distortion(self) -> Distortion:
        """Errors of lengths and areas."""
        return distortion(self.panel.mesh, self.flat_m)

    @cached_property
    def error(self) -> float:
        """Root mean square error of lengths; infinite where the flat panel lies over itself."""
        import shapely

        outline = shapely.Polygon(self.flat_m[self.panel.loops[0]])
        return self.distortion.rms_length if outline.is_valid else np.inf


def cut_to_fit(
    garment: SurfaceMesh, design: Bools, front: Floats, seam_side: Floats, max_distortion: float, max_panels: int
) -> tuple[Cloth, list[FlatPanel]]:
    """The garment cut into panels, each laid flat.

    :param garment: one piece with at least one opening.
    :param design: reinforced triangles, which seams of tubes keep clear of, ``(triangles,)``.
    :param front: unit vector in the direction that the wearer faces, ``(3,)``.
    :param seam_side: unit vector from a tube's axis to where its seam should be, ``(3,)``.
    :param max_distortion: panels whose root mean square error of lengths is above this are halved.
    :param max_panels: panels are halved while there are fewer than this.
    :return: the cloth with its seams, and its panels laid flat.
    :raises InputError: more than one piece, handles, no opening, or a panel that cannot be laid flat.
    """
    cloth = Cloth.uncut(garment)
    openings = _openings(garment, cloth)
    if openings > 2 and (parted := _front_and_back(cloth, front)) is not None:
        cloth = parted
    while tubes := [panel for panel in cloth.panels if len(panel.loops) > 1]:
        cloth = _joined(cloth, tubes[0], design, seam_side)
    panels = [_laid_flat(panel) for panel in cloth.panels]
    while len(panels) < max_panels and (finer := _halved(cloth, panels, design, max_distortion)) is not None:
        cloth, panels = finer
    over = [i for i, panel in enumerate(panels) if np.isinf(panel.error)]
    if over:
        raise InputError(
            f"{garment.name}: {len(over)} of {len(panels)} panels overlap themselves when flat "
            f"(more than {max_panels} panels may help)"
        )
    return cloth, panels


def _openings(garment: SurfaceMesh, cloth: Cloth) -> int:
    if len(cloth.panels) != 1:
        raise InputError(f"{garment.name}: it is in {len(cloth.panels)} pieces; expected one")
    whole = cloth.panels[0]
    openings = len(whole.loops)
    if openings < 1 or whole.euler != 2 - openings:
        raise InputError(
            f"{garment.name}: {openings} openings and Euler number {whole.euler}; expected at least 1 opening, "
            "and the Euler number 2 - openings (no handles)"
        )
    return openings


def _laid_flat(panel: Panel, settled: float = SETTLED) -> FlatPanel:
    return FlatPanel(panel, flatten(panel.mesh, settled))


def _front_and_back(cloth: Cloth, front: Floats) -> Cloth | None:
    """Parted where the smoothed cloth turns from facing the front to facing the back; None if that never gives two discs."""
    from scipy.sparse.linalg import splu

    igl, whole = libigl(), cloth.panels[0]
    mass = igl.massmatrix(whole.mesh.vertices_m, whole.mesh.triangles, igl.MASSMATRIX_TYPE_BARYCENTRIC)
    laplacian = igl.cotmatrix(whole.mesh.vertices_m, whole.mesh.triangles)
    facing = whole.mesh.vertex_normals @ front
    for length_m in FACING_SMOOTHED_M:
        smoothed = splu((mass - length_m**2 * laplacian).tocsc()).solve(mass @ facing)
        if smoothed.min() < 0 < smoothed.max():
            parted, _ = cloth.cut(cloth.corners_of(whole, smoothed))
            if len(parted.panels) == 2 and all(panel.is_disc for panel in parted.panels):
                return parted
    return None


def _joined(cloth: Cloth, tube: Panel, design: Bools, seam_side: Floats) -> Cloth:
    """A seam from the longest boundary loop of a panel to the one that is easiest to reach."""
    path = _easiest_path(tube, design[cloth.parents[tube.faces]], seam_side)
    edges = np.sort(tube.origin[np.stack([path[:-1], path[1:]], axis=1)], axis=1)
    by_hand = cloth.cut_along(edges)
    for width in SMOOTHED_OVER:
        level = _level_about(tube, path, by_hand, width)
        if level is not None:
            smooth, _ = cloth.cut(cloth.corners_of(tube, *level))
            if _loops(smooth) == _loops(by_hand) and len(smooth.panels) == len(by_hand.panels):
                return smooth
    return by_hand


def _loops(cloth: Cloth) -> int:
    return sum(len(panel.loops) for panel in cloth.panels)


def _easiest_path(tube: Panel, reinforced: Bools, seam_side: Floats) -> Ints:
    """Dijkstra's path over edges between two boundary loops, as vertex numbers."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra

    mesh, size = tube.mesh, (len(tube.mesh.vertices_m),) * 2
    a, b = mesh.edges.T
    # Smoothing will move the seam by some edges: keep it as far from the reinforcement.
    near = np.zeros(len(mesh.vertices_m))
    if reinforced.any():
        steps = coo_matrix((np.ones(len(a)), (a, b)), shape=size).tocsr()
        away = dijkstra(steps, directed=False, indices=np.unique(mesh.triangles[reinforced]), min_only=True)
        near = np.clip(1 - away / (SMOOTHED_OVER[0] + 1), 0.0, 1.0)
    far_side = 0.5 * (1 - mesh.vertex_normals @ seam_side)
    dear = 1 + REINFORCED_DEARER * near + FAR_SIDE_DEARER * far_side
    cost = np.linalg.norm(mesh.vertices_m[a] - mesh.vertices_m[b], axis=1) * 0.5 * (dear[a] + dear[b])
    graph = coo_matrix((cost, (a, b)), shape=size).tocsr()
    others = np.concatenate(tube.loops[1:])
    distance, before, _ = dijkstra(graph, directed=False, indices=tube.loops[0], min_only=True, return_predecessors=True)
    path = [int(others[np.argmin(distance[others])])]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return np.array(path)


def _level_about(tube: Panel, path: Ints, by_hand: Cloth, width: int) -> tuple[Floats, Bools] | None:
    """A function on the tube whose zero line runs along ``path`` without its zigzag, and the triangles where it holds.

    It is harmonic between +1 and -1, which it has ``width`` edges away to the left and right of the path. None where the two
    sides meet round the back of the tube.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra
    from scipy.sparse.linalg import splu

    # The same triangles, with the path's vertices twice.
    cut = next(panel for panel in by_hand.panels if panel.faces[0] == tube.faces[0])
    steps = set(pairwise(path.tolist()))
    shores: tuple[list[int], list[int]] = ([], [])
    for corners, copies in zip(tube.mesh.triangles.tolist(), cut.mesh.triangles.tolist(), strict=True):
        for i in range(3):
            a, b = (corners[i], corners[i - 2]), (copies[i], copies[i - 2])
            if a in steps:
                shores[0].extend(b)
            elif a[::-1] in steps:
                shores[1].extend(b)
    one, other = cut.mesh.edges.T
    graph = coo_matrix((np.ones(len(one)), (one, other)), shape=(len(cut.mesh.vertices_m),) * 2).tocsr()
    left, right = (dijkstra(graph, directed=False, indices=sorted(set(shore)), min_only=True) for shore in shores)
    away, side = np.zeros(len(tube.mesh.vertices_m)), np.zeros(len(tube.mesh.vertices_m))
    away[tube.mesh.triangles] = np.minimum(left, right)[cut.mesh.triangles]
    side[tube.mesh.triangles] = np.sign(right - left)[cut.mesh.triangles]
    side[path] = 0
    free = away < width
    strip: Bools = np.any(free[tube.mesh.triangles], axis=1)
    sides = side[tube.mesh.triangles]
    on_path = np.isin(tube.mesh.triangles, path).any(axis=1)
    if np.any(strip & ~on_path & (np.abs(sides.sum(axis=1)) < 3)):
        return None
    laplacian = libigl().cotmatrix(tube.mesh.vertices_m, tube.mesh.triangles[strip])
    level = side.copy()
    level[free] = splu(laplacian[free][:, free].tocsc()).solve(-laplacian[free][:, ~free] @ side[~free])
    return level, strip


def _halved(cloth: Cloth, panels: list[FlatPanel], design: Bools, max_distortion: float) -> tuple[Cloth, list[FlatPanel]] | None:
    """The worst panel that gets better by it cut in two; None where no panel is too bad or none gets better."""
    for whole in sorted(panels, key=lambda panel: -panel.error):
        if whole.error <= max_distortion:
            return None
        rated: list[tuple[float, Cloth]] = []
        for level in _straight_lines(whole):
            corners = cloth.corners_of(whole.panel, level)
            crossed = (corners.min(axis=1) < 0) & (corners.max(axis=1) > 0)
            trial, before = cloth.cut(corners)
            parts = [panel for panel in trial.panels if np.isin(before[panel.faces[0]], whole.panel.faces)]
            shares = [panel.mesh.areas_m2.sum() / whole.panel.mesh.areas_m2.sum() for panel in parts]
            if min(shares) >= SMALLEST_SHARE:
                worst = max(_laid_flat(panel, ROUGHLY_SETTLED).error for panel in parts)
                if worst < WORTH_A_SEAM * whole.error:
                    rated.append((worst * (1 + design[cloth.parents[crossed]].mean()), trial))
        if rated:
            best = min(rated, key=lambda pair: pair[0])[1]
            return best, [_laid_flat(panel) for panel in best.panels]
    return None


def _straight_lines(whole: FlatPanel) -> list[Floats]:
    """Signed distances of the flat vertices from lines along and across the panel, through its middle and its worst place."""
    corners = whole.flat_m[whole.panel.mesh.triangles]
    areas, centres = whole.panel.mesh.areas_m2, corners.mean(axis=1)
    stretches = np.linalg.svd(gradients(whole.panel.mesh, whole.flat_m), compute_uv=False)
    middle = np.average(centres, axis=0, weights=areas)
    worst = np.average(centres, axis=0, weights=areas * ((stretches - 1) ** 2).sum(axis=1) + 1e-12 * areas)
    _, axes = np.linalg.eigh(np.cov((centres - middle).T, aweights=areas))
    return [(whole.flat_m - point) @ axis for axis in axes.T for point in (middle, worst)]
