"""Designs as files: patterns for the cutter, meshes for everything else; and bodies, to draw around."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from haptics.errors import InputError
from haptics.garments.bodies import MOTIONS, STRAIGHT, Body
from haptics.garments.design.job import KeptDesigns
from haptics.garments.design.rating import solved
from haptics.garments.mesh import SurfaceMesh
from haptics.garments.mesh_files import write_obj, write_ply, write_surface
from haptics.garments.pattern import Pattern, PatternOptions, make_pattern, write_pattern
from haptics.recording.output import check_outputs, make_folder
from haptics.units import one_of


@dataclass(frozen=True, eq=False)
class Export:
    """A pattern and the files written.

    :param step: number of the design in its sequence.
    :param coverage: reinforced over designable area, 0 to 1.
    :param pattern: what was cut.
    :param files: what was written.
    :param notes: what was mended of the garment's mesh, for people.
    """

    step: int
    coverage: float
    pattern: Pattern
    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Plain data: pieces with their areas and distortion, seams with their lengths.

        :return: JSON-ready; units are in the keys.
        """
        pattern = self.pattern
        return {
            "step": self.step,
            "coverage": self.coverage,
            "pieces": [
                {
                    "name": panel.name,
                    "area_cm2": 1e4 * float(panel.flat.panel.mesh.areas_m2.sum()),
                    "reinforcement_cm2": 1e4 * panel.cut.area_m2,
                    "distortion_rms": panel.flat.distortion.rms_length,
                    "distortion_largest": panel.flat.distortion.largest_length,
                    "narrow_places": len(panel.narrow),
                }
                for panel in pattern.panels
            ],
            "seams": [
                {
                    "number": seam.number,
                    "length_cm": 1e2 * seam.length_m,
                    "sides_cm": [1e2 * side.length_m for side in seam.sides],
                    "pieces": [pattern.panels[side.panel].name for side in seam.sides],
                }
                for seam in pattern.seams
            ],
            "reinforced_cm2": 1e4 * pattern.reinforced_area_m2,
            "cut_cm2": 1e4 * pattern.cut_area_m2,
            "flat_area_ratio": pattern.flat_area_ratio,
            "notes": list(self.notes),
            "files": [str(path) for path in self.files],
        }


def export_body(
    body: Body, path: Path, motion: str | None = None, angle_deg: float | None = None, force: bool = False
) -> dict[str, Any]:
    """Write a body's skin as OBJ, in metres, z up, facing -y: what a garment can be drawn around.

    :param body: the body.
    :param path: an .obj file.
    :param motion: put it at this angle of a motion; None: straight, as a garment's mesh is laid on.
    :param angle_deg: of the motion, degrees from straight; None: its default.
    :param force: overwrite a file that exists.
    :return: what was written, as plain data.
    :raises InputError: another suffix, a file that exists and is not forced, no such folder, an unknown motion, an angle that it
        does not reach or that has no motion.
    """
    if motion is None and angle_deg is not None:
        raise InputError(f"angle_deg = {angle_deg:g} without a motion; pass --motion too")
    pose, posture, notes = STRAIGHT, "straight", []
    if motion is not None:
        chosen = MOTIONS[one_of("motion", motion, tuple(MOTIONS))]
        angle_deg = chosen.checked_deg(angle_deg)
        pose, posture = chosen.pose(angle_deg), f"{motion} by {angle_deg:g} degrees"
        notes.append("to look at only: a garment is drawn around the straight body, without --motion")
    mesh = SurfaceMesh(body.posed_m(pose), body.triangles, body.name)
    write_surface(mesh, f"body {body.name}, {posture}; metres, z up, facing -y, its left at +x", path, force)
    return {
        **{"body": body.name, "pose": posture, "units": "m", "up": "z", "faces": "-y"},
        **{"vertices": len(mesh.vertices_m), "triangles": len(mesh.triangles), "notes": notes, "files": [str(path)]},
    }


def export_design(
    kept: KeptDesigns,
    out: Path,
    step: int | None = None,
    coverage: float | None = None,
    options: PatternOptions | None = None,
    force: bool = False,
) -> Export:
    """Write one design of a sequence: pattern sheets as SVG and DXF, and the mesh as OBJ and PLY.

    OBJ: the garment at rest, where it is not stretched. PLY: in equilibrium at the end of the motion, with its energy.

    :param kept: the sequence on its body.
    :param out: folder, made unless it is there; the one it lies in must be.
    :param step: number of the design in the sequence, from 0; None: see ``coverage``.
    :param coverage: reinforced over designable area, from that of the sequence's last step to 1: of the designs that have it the
        densest, else the nearest. With neither, the design of the coverage that the sequence was made for.
    :param options: of the pattern; None takes the defaults.
    :param force: overwrite files that exist.
    :return: the pattern and the files written: ``GARMENT-NUMBER`` with .svg, .dxf, .obj, .mtl and .ply.
    :raises InputError: both a step and a coverage, or one out of range; no folder to make ``out`` in; files that exist; or as
        in ``make_pattern`` and ``write_pattern``.
    :raises Unconverged: the design has no equilibrium any more.
    """
    number, chosen = kept.step(step, coverage)
    sim, settings = kept.worn.simulation, kept.settings
    name = kept.worn.garment.name
    stem = f"{name}-{number:03d}"
    make_folder(out)
    check_outputs({suffix: out / f"{stem}{suffix}" for suffix in (".obj", ".mtl", ".ply", ".svg", ".dxf")}, force)
    labels = {
        "body": settings["body"] + "".join(f", {name} {value:g}" for name, value in sorted(settings["phenotype"].items())),
        "motion": f"{settings['motion']} by {settings['angle_deg']:g} degrees",
        "coverage": f"{100 * chosen.coverage:.1f} %, step {number}",
    }
    pattern = make_pattern(sim.rest, chosen.design, name, labels, options)
    state = solved(sim, chosen.design, kept.sequence.at_final.positions_m if chosen is kept.sequence.final else None)
    files = write_pattern(pattern, out, stem, force)
    files += write_obj(sim.rest, chosen.design, out / f"{stem}.obj", force)
    files += write_ply(sim.rest.at(state.positions_m), chosen.design, state.element_energy_j, out / f"{stem}.ply", force)
    return Export(number, chosen.coverage, pattern, tuple(files), kept.worn.garment.notes)
