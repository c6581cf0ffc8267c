"""A design as files: patterns for the cutter, meshes for everything else."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from haptics.errors import InputError
from haptics.garments.design.design_job import KeptDesigns
from haptics.garments.design.rating import solved
from haptics.garments.mesh_files import write_obj, write_ply
from haptics.garments.pattern import Pattern, PatternOptions, make_pattern, write_pattern
from haptics.recording.output import refuse_existing


@dataclass(frozen=True, eq=False)
class Export:
    """A pattern and the files written."""

    step: int
    coverage: float
    pattern: Pattern
    files: tuple[Path, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain data: pieces with their areas and distortion, seams with their lengths."""
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
            "files": [str(path) for path in self.files],
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

    :param out: folder, made if need be. :param step, coverage: which design; the one asked for if None.
    :raises InputError: files that exist, no such step, or as ``make_pattern`` and ``write_pattern``.
    :raises Unconverged: the design has no equilibrium any more.
    """
    number, chosen = kept.step(step, coverage)
    sim, settings = kept.worn.simulation, kept.settings
    name = kept.worn.garment.name
    stem = f"{name}-{number:03d}"
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out}: no folder can be made there ({error.strerror or error})") from error
    for suffix in (".obj", ".mtl", ".ply", ".svg", ".dxf"):
        refuse_existing(out / f"{stem}{suffix}", force)
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
    return Export(number, chosen.coverage, pattern, tuple(files))
