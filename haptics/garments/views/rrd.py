"""A garment in motion as a file for the rerun viewer (extra ``view``): what a person looks at, never the archive.

Its timeline ``angle_deg`` is the motion's angle from straight, a second a degree, so that the viewer plays the motion. The same
evaluation gives the same view; nothing but the file is touched.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from haptics.garments.equilibrium.wearing import MotionEvaluation, WornMotion
from haptics.garments.mesh import Floats, SurfaceMesh
from haptics.garments.views.pictures import SKIN, brightest
from haptics.recording.views.rerun_library import open_rerun, viewer_file

TIMELINE = "angle_deg"
LOWEST_COLOUR, HIGHEST_COLOUR = np.array([68.0, 1.0, 84.0]), np.array([253.0, 231.0, 37.0])
_SKIN_COLOUR = np.rint(255 * SKIN).astype(np.uint8)


def write_motion_rrd(worn: WornMotion, found: MotionEvaluation, path: Path, force: bool = False) -> Path:
    """Write a design's motion: the body, the garment coloured by its energy, energy and joint torque by angle.

    Colours run from no energy (dark violet) to the density that 98 % of the cloth is below at its maximum over the angles
    (yellow), alike for all angles.

    :param worn: the garment on its body.
    :param found: the design over the motion.
    :param path: an .rrd file.
    :param force: overwrite a file that exists.
    :return: the path written.
    :raises InputError: rerun is not installed, or ``path`` exists and ``force`` is not given.
    :raises HapticsError: rerun cannot write the file.
    """
    rr = open_rerun()
    identity = hashlib.sha256(np.concatenate([found.angles_deg, *(e.positions_m.ravel() for e in found.equilibria)]).tobytes())
    with viewer_file(rr, path, force, "haptics garment", identity.hexdigest()[:32], _blueprint) as stream:
        _Writer(rr, stream, worn, found).write()
    return path


class _Writer:
    def __init__(self, rr: Any, stream: Any, worn: WornMotion, found: MotionEvaluation):
        self._rr, self._stream, self._worn, self._found = rr, stream, worn, found

    def write(self) -> None:
        rr, found = self._rr, self._found
        self._stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        skins = [SurfaceMesh(self._worn.posed_m(angle), self._worn.body.triangles) for angle in found.angles_deg]
        cloths = [self._worn.simulation.rest.at(state.positions_m) for state in found.equilibria]
        self._mesh("world/body", skins, [np.broadcast_to(_SKIN_COLOUR, skins[0].vertices_m.shape)] * len(skins))
        self._mesh("world/garment", cloths, self._colours())
        for path, name, values in (
            ("energy_j", "strain energy (J)", found.energy_j),
            ("torque_n_m", "torque against the motion (N m)", found.torque_n_m),
        ):
            self._stream.log(path, rr.SeriesLines(names=[name]), static=True)
            self._send(path, values[:, None], lambda rows: rr.Scalars.columns(scalars=rows))

    def _mesh(self, path: str, meshes: list[SurfaceMesh], colours: list[Any]) -> None:
        rr = self._rr
        self._stream.log(path, rr.Mesh3D.from_fields(triangle_indices=meshes[0].triangles.astype(np.uint32)), static=True)
        self._send(path, _single([m.vertices_m for m in meshes]), lambda rows: rr.Mesh3D.columns(vertex_positions=rows))
        self._send(path, _single([m.vertex_normals for m in meshes]), lambda rows: rr.Mesh3D.columns(vertex_normals=rows))
        self._send(path, np.stack(colours), lambda rows: rr.Mesh3D.columns(vertex_colors=rows))

    def _colours(self) -> list[Any]:
        """By the mean density of the triangles round a vertex, ``(vertices, 3)`` for each angle."""
        rest = self._worn.simulation.rest
        densities = [state.element_energy_j / rest.areas_m2 for state in self._found.equilibria]
        highest = max(brightest(density, rest.areas_m2) for density in densities)
        corners = rest.triangles.ravel()
        out = []
        for state in self._found.equilibria:
            energy = np.bincount(corners, np.repeat(state.element_energy_j / 3, 3), minlength=len(rest.vertices_m))
            share = np.clip(energy / rest.vertex_areas_m2 / highest, 0.0, 1.0)[:, None]
            out.append(np.rint((1 - share) * LOWEST_COLOUR + share * HIGHEST_COLOUR).astype(np.uint8))
        return out

    def _send(self, path: str, values: Any, columns: Callable[[Any], Any]) -> None:
        """``values`` (angles, n, ...) as rows of n."""
        angles = self._rr.TimeColumn(TIMELINE, duration=self._found.angles_deg)
        flat = columns(values.reshape(-1, *values.shape[2:]))
        self._stream.send_columns(path, [angles], flat.partition(np.full(len(values), values.shape[1])))


def _single(arrays: list[Floats]) -> Any:
    return np.stack(arrays).astype(np.float32)


def _blueprint() -> Any:
    import rerun.blueprint as rrb

    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(origin="/world", name="Garment, coloured by strain energy"),
            rrb.Vertical(
                rrb.TimeSeriesView(origin="/energy_j", name="Strain energy (J)"),
                rrb.TimeSeriesView(origin="/torque_n_m", name="Torque against the motion (N m)"),
            ),
            column_shares=[2, 1],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )
